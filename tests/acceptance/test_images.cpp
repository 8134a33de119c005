// Regions from images and from other models, through the real daemon.

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "tests/acceptance/bodies.h"
#include "tests/acceptance/daemon.h"
#include "tests/server/synthetic.h"
#include "tests/support/png_file.h"

using namespace pointwright;
using namespace pointwright::test;
using nlohmann::json;

namespace {

constexpr std::uint32_t kSide = 16;
constexpr const char* kUnknownId = "AAAAAAAAAAAAAAAAAAAAAA";

// A white page with a dark letter L; y from the top.
int page(std::uint32_t x, std::uint32_t y) {
  const bool upright = x >= 4 && x < 7 && y >= 3 && y < 13;
  const bool foot = x >= 4 && x < 12 && y >= 10 && y < 13;
  return upright || foot ? 20 : 240;
}

std::string page_file() {
  return grey_png(kSide, kSide, page);
}

// The page's value at (u, v) with v up, bilinear between the middles of pixels.
double page_value(double u, double v) {
  const auto clamped = [](double at) {
    return static_cast<std::uint32_t>(std::clamp(at, 0.0, static_cast<double>(kSide - 1)));
  };
  const double x = u * kSide - 0.5;
  const double y = (1.0 - v) * kSide - 0.5;
  const double fx = x - std::floor(x);
  const double fy = y - std::floor(y);
  const auto row = [&](double at) {
    return (1.0 - fx) * page(clamped(std::floor(x)), clamped(at)) +
           fx * page(clamped(std::floor(x) + 1.0), clamped(at));
  };
  return ((1.0 - fy) * row(std::floor(y)) + fy * row(std::floor(y) + 1.0)) / 255.0;
}

Reply upload_image(Daemon& daemon, const std::string& file) {
  return daemon.ask("POST", "/v1/images", file, "Content-Type: image/png\r\n");
}

std::string image_shape(const std::string& id, const std::string& side, const std::string& projection) {
  return R"({"type":"image","image":")" + id + R"(","side":")" + side + R"(","projection":)" + projection +
         "}";
}

std::string operation(const std::string& shape) {
  return R"({"mode":"add","shape":)" + shape + "}";
}

const std::string kPlane = R"({"type":"planar","origin":[0,0,0],"u":[1,0,0],"v":[0,1,0],"depth":[-1,1]})";

// wavy_sheet() whose texture coordinates are its x and y.
Cloud textured_sheet(std::size_t side) {
  Cloud cloud = wavy_sheet(side);
  for (std::size_t i = 0; i < cloud.size(); ++i)
    cloud.texcoord.push_back({cloud.position.x()[i], cloud.position.y()[i]});
  return cloud;
}

std::string first_pointer(const Reply& reply) {
  return reply.json()["errors"][0]["pointer"];
}

}  // namespace

TEST_CASE("an image is uploaded, listed, given back and deleted") {
  Daemon daemon;
  const std::string file = page_file();
  const Reply uploaded = upload_image(daemon, file);
  REQUIRE(uploaded.status == 201);
  const json document = uploaded.json();
  const std::string path = "/v1/images/" + document["id"].get<std::string>();
  CHECK(uploaded.headers.at("location") == path);
  CHECK(document["width"] == kSide);
  CHECK(document["height"] == kSide);
  CHECK(document["channels"] == json{"grey"});
  CHECK(document["bytes"] == file.size());
  CHECK(daemon.get("/v1/images").json()["images"] == json::array({document}));
  const Reply one = daemon.get(path);
  CHECK(one.json() == document);
  CHECK(one.headers.at("etag") == uploaded.headers.at("etag"));
  CHECK(daemon.get(path, "If-None-Match: " + one.headers.at("etag") + "\r\n").status == 304);
  const Reply data = daemon.get(path + "/data");
  CHECK(data.headers.at("content-type") == "image/png");
  CHECK(data.body == file);
  CHECK(daemon.get(path + "/data", "If-None-Match: " + data.headers.at("etag") + "\r\n").status == 304);
  CHECK(daemon.ask("DELETE", path).status == 204);
  CHECK(daemon.ask("DELETE", path).status == 404);
  CHECK(daemon.get(path).status == 404);
  CHECK(daemon.get(path + "/data").status == 404);
  CHECK(daemon.get("/v1/images").json()["images"].empty());
  const json limits = daemon.get("/v1/info").json()["limits"];
  CHECK(limits["max_image_side"] == 32'768);
  CHECK(limits["max_image_pixels"] == 67'108'864);
}

TEST_CASE("what is no image, too large or too much is refused, and the daemon lives on") {
  Daemon daemon({"--max-images", "1", "--max-image-side", "64", "--max-image-file-bytes", "100000"});
  const std::string file = page_file();
  CHECK(daemon.ask("POST", "/v1/images", file, "Content-Type: image/jpeg\r\n").status == 415);
  CHECK(daemon.ask("POST", "/v1/images", file, "Content-Type: application/octet-stream\r\n").status == 415);
  CHECK(upload_image(daemon, "").status == 400);
  CHECK(upload_image(daemon, "GIF89a").status == 415);
  CHECK(upload_image(daemon, std::string(100'001, 'x')).status == 413);
  CHECK(upload_image(daemon, file.substr(0, file.size() / 2)).status == 422);
  CHECK(upload_image(daemon, file.substr(0, 20)).status == 422);
  const Reply wide = upload_image(daemon, grey_png(65, 1, [](auto, auto) { return 0; }));
  CHECK(wide.status == 413);
  CHECK(wide.json()["limit"] == 64);
  CHECK(wide.json()["actual"] == 65);
  // A gigapixel in a few bytes: refused by its header.
  std::string bomb = file;
  bomb.replace(16, 8, std::string("\x7F\xFF\xFF\xFF\x7F\xFF\xFF\xFF", 8));
  CHECK(upload_image(daemon, bomb).status == 413);
  REQUIRE(upload_image(daemon, file).status == 201);
  const Reply second = upload_image(daemon, file);
  CHECK(second.status == 429);
  CHECK(second.json()["limit"] == 1);
  CHECK(daemon.is_alive());

  Daemon small({"--max-image-bytes", "100"});
  CHECK(upload_image(small, file).status == 507);
}

TEST_CASE("a letter is embossed: dark pixels rise, bright ones stay (Figure 10)") {
  Daemon daemon;
  const Cloud original = textured_sheet(80);
  const Reply cloud = daemon.upload(file_of(original), "application/x-ply");
  REQUIRE(cloud.status == 201);
  const std::string session = daemon.open_session(cloud.json()["id"]);
  const std::string image = upload_image(daemon, page_file()).json()["id"];

  const Reply bright = daemon.ask("POST", session + "/regions/zero/operations",
                                  operation(image_shape(image, "above", kPlane)));
  REQUIRE_MESSAGE(bright.status == 200, bright.body);
  const Reply dark =
      daemon.ask("POST", session + "/regions/one/operations", operation(image_shape(image, "below", kPlane)));
  REQUIRE(dark.status == 200);
  CHECK(bright.json()["changed"].get<std::size_t>() + dark.json()["changed"].get<std::size_t>() ==
        original.size());

  const Reply edit = daemon.ask("POST", session + "/edits",
                                R"({"level":0,"deformation":{"type":"translation","vector":[0,0,0.25]}})",
                                "If-Match: " + dark.headers.at("etag") + "\r\n");
  REQUIRE_MESSAGE(edit.status == 201, edit.body);
  const Cloud before = in_caller_order(original);
  const Cloud after = cloud_of(daemon.get(session + "/samples?format=ply").body);
  REQUIRE(after.size() == before.size());
  std::size_t raised = 0;
  for (std::size_t i = 0; i < after.size(); ++i) {
    const Vec3d a = model_position(before, i);
    const Vec3d b = model_position(after, i);
    const double value = page_value(a.x(), a.y());
    CHECK(std::abs(value - 0.5) > 1e-6);
    if (value >= 0.5) {
      CHECK(a == b);
      continue;
    }
    ++raised;
    CHECK(std::abs(b.z() - a.z() - 0.25) < 1e-5);
    CHECK((b - a).head<2>().norm() < 1e-5);
  }
  CHECK(raised == dark.json()["changed"].get<std::size_t>());
  CHECK(raised > 500);

  // By texture coordinates, the same samples; the painting says what it was painted with.
  const std::string by_texture = operation(image_shape(image, "below", R"({"type":"texture"})"));
  REQUIRE(daemon.ask("PUT", session + "/head", R"({"edit":0})").status == 200);
  REQUIRE(daemon.ask("PUT", session + "/regions/one", R"({"operations":[]})").status == 200);
  const Reply textured = daemon.ask("POST", session + "/regions/one/operations", by_texture);
  REQUIRE_MESSAGE(textured.status == 200, textured.body);
  CHECK(textured.json()["changed"] == raised);
  CHECK(daemon.ask("DELETE", "/v1/images/" + image).status == 204);
  const json painting = daemon.get(session + "/regions/one").json();
  CHECK(painting["samples"] == raised);
  // What is recorded needs no image any more.
  CHECK(painting["operations"][0]["shape"]["type"] == "points");
  REQUIRE(daemon.ask("PUT", session + "/regions/one", json{{"operations", painting["operations"]}}.dump())
              .status == 200);
  CHECK(daemon.get(session + "/regions/one").json()["samples"] == raised);
}

TEST_CASE("a shape says what it lacks: an image, a cloud, texture coordinates") {
  Daemon daemon;
  const std::string cloud = daemon.upload(file_of(wavy_sheet(20))).json()["id"];
  const std::string session = daemon.open_session(cloud);
  const std::string image = upload_image(daemon, page_file()).json()["id"];
  const auto refused = [&](const std::string& shape) {
    const Reply reply = daemon.ask("POST", session + "/regions/one/operations", operation(shape));
    CHECK(reply.status == 422);
    return first_pointer(reply);
  };
  CHECK(refused(image_shape(kUnknownId, "above", kPlane)) == "/shape/image");
  CHECK(refused(image_shape(image, "above", R"({"type":"texture"})")) == "/shape/projection");
  CHECK(
      refused(image_shape(image, "above", R"({"type":"planar","origin":[0,0,0],"u":[1,0,0],"v":[2,0,0]})")) ==
      "/shape/projection/v");
  const std::string matrix = R"("matrix":[1,0,0,0,0,1,0,0,0,0,1,0,0,0,0,1],"thickness":0.1})";
  CHECK(refused(R"({"type":"model","cloud":")" + std::string(kUnknownId) + "\"," + matrix) == "/shape/cloud");
  // Of a whole painting, the operation too.
  const Reply whole = daemon.ask(
      "PUT", session + "/regions/one",
      R"({"operations":[{"mode":"clear"},)" + operation(image_shape(kUnknownId, "above", kPlane)) + "]}");
  CHECK(whole.status == 422);
  CHECK(first_pointer(whole) == "/operations/1/shape/image");
  CHECK(daemon.get(session).headers.at("etag") == "\"r0\"");
}

TEST_CASE("another model, aligned by a matrix, paints where it touches") {
  Daemon daemon;
  const Cloud sheet = wavy_sheet(40);
  const std::string session = daemon.open_session(daemon.upload(file_of(sheet)).json()["id"]);
  const Cloud pin = wavy_sheet(3);  // 9 samples half a unit apart
  const std::string model = daemon.upload(file_of(pin)).json()["id"];
  // A quarter turn about z, half as large, into the middle of the sheet.
  const Reply painted =
      daemon.ask("PUT", session + "/regions/one",
                 R"({"operations":[{"mode":"add","shape":{"type":"model","cloud":")" + model +
                     R"(","matrix":[0,-0.5,0,0.75,0.5,0,0,0.25,0,0,0.5,0,0,0,0,1],"thickness":0.0625}}]})");
  REQUIRE_MESSAGE(painted.status == 200, painted.body);
  std::size_t expected = 0;
  for (std::size_t i = 0; i < sheet.size(); ++i) {
    bool is_near = false;
    for (std::size_t k = 0; k < pin.size(); ++k) {
      const Vec3d p = pin.position[k].cast<double>();
      const Vec3d moved(0.75 - 0.5 * p.y(), 0.25 + 0.5 * p.x(), 0.5 * p.z());
      is_near = is_near || (sheet.position[i].cast<double>() - moved).norm() <= 0.0625;
    }
    expected += is_near ? 1 : 0;
  }
  CHECK(expected > 50);
  const json painting = daemon.get(session + "/regions/one").json();
  CHECK(painting["samples"] == expected);
  CHECK(painting["operations"][0]["shape"]["type"] == "points");
  CHECK(daemon.ask("DELETE", "/v1/clouds/" + model).status == 204);
}

// The two programs from outside: starting, refusing to start, files, and the command-line tool.

#include <doctest/doctest.h>

#include <csignal>
#include <filesystem>
#include <fstream>

#include "engine/io/cloud_io.h"
#include "tests/acceptance/daemon.h"
#include "tests/server/synthetic.h"

using namespace pointwright;
using namespace pointwright::test;

namespace {

void write_file(const std::string& path, const std::string& text) {
  std::ofstream(path, std::ios::binary) << text;
}

std::string read_text(const std::string& path) {
  std::ostringstream text;
  text << std::ifstream(path, std::ios::binary).rdbuf();
  return text.str();
}

std::string sheet_file(const TemporaryFolder& folder, CloudFormat format, const std::string& name) {
  const auto file = write_cloud(wavy_sheet(20), format, {});
  REQUIRE(file.ok());
  write_file(folder / name, {reinterpret_cast<const char*>(file.value().data()), file.value().size()});
  return folder / name;
}

}  // namespace

TEST_CASE("samples given at the start are there, under their names") {
  const TemporaryFolder folder;
  Daemon daemon({"--sample", sheet_file(folder, CloudFormat::kDraco, "sheet.drc") + "=A wavy sheet"});
  const auto clouds = daemon.get("/v1/clouds").json()["clouds"];
  REQUIRE(clouds.size() == 1);
  CHECK(clouds[0]["name"] == "A wavy sheet");
  CHECK(clouds[0]["sample_count"] == 400);
  CHECK(clouds[0]["report"]["format"] == "draco");
}

TEST_CASE("the address that is printed can be opened, of IPv6 too") {
  const Ended ended = run({POINTWRIGHTD_PATH, "--host", "::1", "--port", "0"}, std::chrono::seconds(2));
  if (ended.status == 1) return;  // a machine without IPv6
  CHECK(ended.out.find("http://[::1]:") != std::string::npos);
}

TEST_CASE("the viewer's files are served from an exact table and nothing else of the folder") {
  const TemporaryFolder folder;
  std::filesystem::create_directories(folder / "web/assets");
  write_file(folder / "web/index.html", "<!doctype html><title>viewer</title>");
  write_file(folder / "web/assets/app-1234.js", "export {};");
  write_file(folder / "web/.secret", "no");
  write_file(folder / "outside.txt", "no");
  std::filesystem::create_symlink(folder / "outside.txt", folder / "web/link.txt");
  Daemon daemon({"--web", folder / "web"});
  Reply page = daemon.get("/", "Accept: text/html,*/*;q=0.8\r\n");
  CHECK(page.status == 200);
  CHECK(page.headers["content-type"] == "text/html; charset=utf-8");
  CHECK(page.headers["content-security-policy"].find("default-src 'none'") == 0);
  CHECK(daemon.get("/", "Accept: application/json\r\n").json()["service"] == "pointwright");
  Reply script = daemon.get("/assets/app-1234.js", "Accept-Encoding: gzip\r\n");
  CHECK(script.body == "export {};");
  CHECK(script.headers["cache-control"].find("immutable") != std::string::npos);
  CHECK(daemon.get("/assets/app-1234.js", "If-None-Match: " + script.headers["etag"] + "\r\n").status == 304);
  for (const char* path : {"/.secret", "/link.txt", "/../outside.txt", "/%2e%2e/outside.txt", "/assets/",
                           "/assets/app-1234.js/", "/assets//app-1234.js", "/assets/app-1234.js%20"})
    CHECK_MESSAGE(daemon.get(path).status == 404, path);
  CHECK(daemon.get("/assets/app-1234.js%00.png").status == 400);
  CHECK(daemon.ask("DELETE", "/assets/app-1234.js").status == 405);
}

TEST_CASE("every answer carries a request id that the log knows") {
  Daemon daemon;
  Reply reply = daemon.get("/v1/info", "X-Request-Id: find-me-42\r\n");
  CHECK(reply.headers["x-request-id"] == "find-me-42");
  CHECK(daemon.get("/nowhere%0a").status == 400);
  Reply missing = daemon.get("/nowhere");
  CHECK(missing.json()["request_id"] == missing.headers["x-request-id"]);
  CHECK(daemon.stop(SIGTERM) == 0);
  std::istringstream log(daemon.log());
  bool found = false;
  for (std::string line; std::getline(log, line);) {
    const auto event = nlohmann::json::parse(line, nullptr, false);
    CHECK_MESSAGE(event.is_object(), line);
    if (event.is_object() && event.value("request_id", "") == "find-me-42")
      found = event.value("status", 0) == 200;
  }
  CHECK(found);
}

TEST_CASE("a daemon that cannot serve says why and exits with an error") {
  Daemon first;
  const Ended second =
      run({POINTWRIGHTD_PATH, "--port", std::to_string(first.port())}, std::chrono::seconds(5));
  CHECK(second.status == 1);
  CHECK(second.err.find("port") != std::string::npos);
  CHECK(first.get("/healthz").status == 200);
  CHECK(run({POINTWRIGHTD_PATH, "--host", "0.0.0.0", "--port", "0"}).status == 2);
  CHECK(run({POINTWRIGHTD_PATH, "--no-such-option"}).status == 2);
  CHECK(run({POINTWRIGHTD_PATH, "--port", "0", "--web", "/nonexistent"}).status == 1);
  CHECK(run({POINTWRIGHTD_PATH, "--port", "0", "--sample", "/nonexistent.ply"}).status == 1);
  CHECK(run({POINTWRIGHTD_PATH, "--port", "0", "--log-file", "/dev/null/log"}).status == 1);
  CHECK(run({POINTWRIGHTD_PATH, "--port", "0", "--port-file", "/dev/null/port"}).status == 1);
  CHECK(run({POINTWRIGHTD_PATH, "--version"}).out.find("pointwrightd ") == 0);
}

TEST_CASE("convert keeps positions and attributes through every format that holds them") {
  const TemporaryFolder folder;
  const std::string ply = sheet_file(folder, CloudFormat::kPly, "sheet.ply");
  CHECK(run({POINTWRIGHT_PATH, "convert", ply, folder / "a.drc"}).status == 0);
  CHECK(run({POINTWRIGHT_PATH, "convert", folder / "a.drc", folder / "b.ply"}).status == 0);
  CHECK(read_text(folder / "b.ply") == read_text(ply));
  CHECK(run({POINTWRIGHT_PATH, "convert", ply, folder / "text.ply", "--ascii"}).status == 0);
  CHECK(run({POINTWRIGHT_PATH, "convert", folder / "text.ply", folder / "c.ply"}).status == 0);
  CHECK(read_text(folder / "c.ply") == read_text(ply));
  CHECK(run({POINTWRIGHT_PATH, "convert", ply, folder / "small.drc", "--draco-bits", "11"}).status == 0);
  CHECK(std::filesystem::file_size(folder / "small.drc") < std::filesystem::file_size(folder / "a.drc"));
}

TEST_CASE("gzip-compressed files are read, damaged and oversized ones refused") {
  const TemporaryFolder folder;
  const std::string ply = sheet_file(folder, CloudFormat::kPly, "sheet.ply");
  REQUIRE(run({"/bin/gzip", "-k", ply}).status == 0);
  CHECK(run({POINTWRIGHT_PATH, "convert", ply + ".gz", folder / "back.ply"}).status == 0);
  CHECK(read_text(folder / "back.ply") == read_text(ply));
  const std::string whole = read_text(ply + ".gz");
  write_file(folder / "cut.gz", whole.substr(0, whole.size() / 2));
  CHECK(run({POINTWRIGHT_PATH, "info", folder / "cut.gz"}).status == 1);
  std::string damaged = whole;
  damaged[whole.size() / 2] = static_cast<char>(damaged[whole.size() / 2] ^ 0x55);
  write_file(folder / "damaged.gz", damaged);
  CHECK(run({POINTWRIGHT_PATH, "info", folder / "damaged.gz"}).status == 1);
  write_file(folder / "zeros", std::string(3 << 20, '\0'));
  REQUIRE(run({"/bin/gzip", folder / "zeros"}).status == 0);
  const Ended bomb = run({POINTWRIGHT_PATH, "info", folder / "zeros.gz", "--max-mebibytes", "1"});
  CHECK(bomb.status == 1);
  CHECK(bomb.err.find("larger") != std::string::npos);
}

TEST_CASE("info tells what a file holds, for people and as a document") {
  const TemporaryFolder folder;
  const std::string ply = sheet_file(folder, CloudFormat::kPly, "sheet.ply");
  const Ended described = run({POINTWRIGHT_PATH, "info", ply, "--json"});
  REQUIRE(described.status == 0);
  const auto document = nlohmann::json::parse(described.out);
  CHECK(document["sample_count"] == 400);
  CHECK(document["report"]["format"] == "ply");
  CHECK(run({POINTWRIGHT_PATH, "info", ply}).out.find("samples     400") != std::string::npos);
}

TEST_CASE("simplify keeps what it is told to, with the attributes, and smooth keeps all but the detail") {
  const TemporaryFolder folder;
  const std::string ply = sheet_file(folder, CloudFormat::kPly, "sheet.ply");
  const auto document = [&](const std::string& file) {
    return nlohmann::json::parse(run({POINTWRIGHT_PATH, "info", file, "--json"}).out);
  };
  CHECK(run({POINTWRIGHT_PATH, "simplify", ply, folder / "count.ply", "--count", "150"}).out ==
        "400 samples to 150\n");
  CHECK(document(folder / "count.ply")["sample_count"] == 150);
  // The normals that it was simplified with come along.
  CHECK(document(folder / "count.ply")["report"]["attributes"] == nlohmann::json{"normal", "color"});
  CHECK(run({POINTWRIGHT_PATH, "simplify", ply, folder / "ratio.drc", "--ratio", "0.25"}).status == 0);
  CHECK(document(folder / "ratio.drc")["sample_count"] == 100);
  CHECK(run({POINTWRIGHT_PATH, "simplify", ply, folder / "error.ply", "--error", "0.01"}).status == 0);
  CHECK(document(folder / "error.ply")["sample_count"] < 400);
  CHECK(run({POINTWRIGHT_PATH, "smooth", ply, folder / "smooth.ply", "--scale", "0.1"}).status == 0);
  CHECK(document(folder / "smooth.ply")["sample_count"] == 400);
  const auto height = [&](const std::string& file) {
    const auto bounds = document(file)["bounds"];
    return bounds["max"][2].get<double>() - bounds["min"][2].get<double>();
  };
  CHECK(height(folder / "smooth.ply") < 0.8 * height(ply));
  CHECK(
      run({POINTWRIGHT_PATH, "smooth", ply, folder / "steps.ply", "--iterations", "5", "--preserve", "local"})
          .status == 0);
  CHECK(height(folder / "steps.ply") > height(folder / "smooth.ply"));
  const Ended none = run({POINTWRIGHT_PATH, "simplify", ply, folder / "none.ply", "--count", "0"});
  CHECK(none.err.find("--count: ") != std::string::npos);

  for (const std::vector<std::string>& wrong : std::vector<std::vector<std::string>>{
           {"smooth"},
           {"smooth", "--scale", "0.1", "--iterations", "3"},
           {"smooth", "--scale", "0.3"},
           {"smooth", "--scale", "0.1", "--preserve", "much"},
           {"smooth", "--scale", "0.1", "--preserve", "taubin"},
           {"smooth", "--iterations", "3", "--preserve", "global"},  // a sheet has no volume
           {"smooth", "--iterations", "0"},
           {"simplify"},
           {"simplify", "--count", "10", "--ratio", "0.5"},
           {"simplify", "--count", "0"},
           {"simplify", "--ratio", "1.5"},
           {"simplify", "--ratio", "0.5", "--neighbors", "40"}}) {
    std::vector<std::string> command{POINTWRIGHT_PATH, wrong[0], ply, folder / "none.ply"};
    command.insert(command.end(), wrong.begin() + 1, wrong.end());
    const Ended ended = run(command);
    CHECK(ended.status == 2);
    CHECK_FALSE(ended.err.empty());
    CHECK_FALSE(std::filesystem::exists(folder / "none.ply"));
  }
}

TEST_CASE("simplify --method uniform keeps samples as they are, bit by bit and in their order") {
  const TemporaryFolder folder;
  Cloud cloud = wavy_sheet(20);
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    cloud.color[i] = {static_cast<std::uint8_t>(i), static_cast<std::uint8_t>(i / 256), 9, 255};
  }
  const auto file = write_cloud(cloud, CloudFormat::kPly, {});
  REQUIRE(file.ok());
  write_file(folder / "sheet.ply", {reinterpret_cast<const char*>(file.value().data()), file.value().size()});
  const auto read = [&](const std::string& name) {
    const std::string bytes = read_text(folder / name);
    auto result = read_cloud(std::as_bytes(std::span(bytes)), CloudFormat::kPly, {});
    REQUIRE(result.ok());
    return in_caller_order(std::move(result).value().cloud);
  };
  const auto simplify = [&](std::vector<std::string> options) {
    std::vector<std::string> command{POINTWRIGHT_PATH,   "simplify", folder / "sheet.ply",
                                     folder / "few.ply", "--method", "uniform"};
    command.insert(command.end(), options.begin(), options.end());
    return run(command);
  };
  CHECK(simplify({"--count", "100"}).out == "400 samples to 100\n");
  const Cloud all = read("sheet.ply");
  const Cloud few = read("few.ply");
  REQUIRE(few.size() == 100);
  CHECK_FALSE(few.has_normals());
  std::size_t from = 0;
  for (std::size_t i = 0; i < few.size(); ++i) {
    while (from < all.size() && !(all.position[from] == few.position[i] && all.color[from] == few.color[i]))
      ++from;
    CHECK(from++ < all.size());
  }
  CHECK(simplify({"--ratio", "0.25"}).status == 0);
  CHECK(read("few.ply").position == few.position);

  const auto complaint = [&](std::vector<std::string> options) {
    const Ended ended = simplify(std::move(options));
    CHECK(ended.status == 2);
    return ended.err;
  };
  CHECK(complaint({"--error", "0.01"}) == "pointwright: --error: an error bound is for --method quadrics\n");
  CHECK(complaint({"--count", "9", "--neighbors", "8"}) ==
        "pointwright: --neighbors: neighbourhoods are for --method quadrics\n");
  CHECK(complaint({"--ratio", "1.5"}).find("--ratio: ") != std::string::npos);
  CHECK(complaint({"--count", "0"}).find("--count: ") != std::string::npos);
  CHECK_FALSE(complaint({}).empty());
  const Ended other = run({POINTWRIGHT_PATH, "simplify", folder / "sheet.ply", folder / "few.ply", "--count",
                           "9", "--method", "fast"});
  CHECK(other.status == 2);
  CHECK(other.err == "pointwright: --method: quadrics or uniform\n");
}

TEST_CASE("the tool's mistakes have exit statuses and sentences") {
  const TemporaryFolder folder;
  const std::string ply = sheet_file(folder, CloudFormat::kPly, "sheet.ply");
  CHECK(run({POINTWRIGHT_PATH}).status == 2);
  CHECK(run({POINTWRIGHT_PATH, "fly"}).status == 2);
  CHECK(run({POINTWRIGHT_PATH, "convert", ply}).status == 2);
  CHECK(run({POINTWRIGHT_PATH, "convert", ply, folder / "x.ply", "--draco-bits", "12"}).status == 2);
  CHECK(run({POINTWRIGHT_PATH, "convert", ply, folder / "x.drc", "--draco-bits", "99"}).status == 2);
  CHECK(run({POINTWRIGHT_PATH, "convert", ply, folder / "x.obj"}).status == 1);
  CHECK(run({POINTWRIGHT_PATH, "convert", folder / "none.ply", folder / "x.drc"}).status == 1);
  CHECK_FALSE(run({POINTWRIGHT_PATH, "info", folder / "none.ply"}).err.empty());
  CHECK(run({POINTWRIGHT_PATH, "--version"}).status == 0);
}

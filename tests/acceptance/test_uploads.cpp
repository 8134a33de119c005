// Resumable uploads through the real daemon: bytes that survive the client, the daemon and a second writer;
// and what is made of them.

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <thread>

#include "tests/acceptance/bodies.h"
#include "tests/acceptance/daemon.h"
#include "tests/server/raw_client.h"

using namespace pointwright;
using namespace pointwright::test;
using nlohmann::json;

namespace {

const std::string kTus = "Tus-Resumable: 1.0.0\r\n";
const std::string kBytes = "Content-Type: application/offset+octet-stream\r\n";
const std::string kText = "1 2 3\n4 5 6\n7 8 10\n";
const std::string kTextSha256 = "858a97c65932d7408e4f789a738828e732dfaa592ef3b4dad0e6f14e5d21a0e4";

std::string begin_upload(Daemon& daemon, std::size_t length, const std::string& more = "") {
  const Reply made = daemon.ask("POST", "/v1/uploads", "",
                                kTus + "Upload-Length: " + std::to_string(length) + "\r\n" + more);
  REQUIRE(made.status == 201);
  CHECK(made.headers.at("tus-resumable") == "1.0.0");
  CHECK(made.headers.at("upload-offset") == "0");
  return made.headers.at("location");
}

std::string at_offset(std::size_t offset) {
  return kTus + kBytes + "Upload-Offset: " + std::to_string(offset) + "\r\n";
}

Reply patch(Daemon& daemon, const std::string& upload, std::size_t offset, const std::string& bytes,
            const std::string& more = "") {
  return daemon.ask("PATCH", upload, bytes, at_offset(offset) + more);
}

std::string offset_of(Daemon& daemon, const std::string& upload) {
  const Reply head = daemon.ask("HEAD", upload, "", kTus);
  REQUIRE(head.status == 200);
  CHECK(head.headers.at("cache-control") == "no-store");
  return head.headers.at("upload-offset");
}

Reply import_of(Daemon& daemon, const std::string& upload, const std::string& more = "") {
  const std::string id = upload.substr(upload.rfind('/') + 1);
  return daemon.ask("POST", "/v1/clouds", R"({"upload":")" + id + "\"" + more + "}");
}

/// Sends the head of a PATCH and so many bytes of its body.
void send_part(RawClient& client, const std::string& upload, std::size_t offset, const std::string& bytes,
               std::size_t announced) {
  client.send("PATCH " + upload + " HTTP/1.1\r\nHost: localhost\r\n" + at_offset(offset) +
              "Content-Length: " + std::to_string(announced) + "\r\n\r\n" + bytes);
}

std::string sheet(std::size_t side) {
  return file_of(wavy_sheet(side));
}

std::size_t files_in(const std::string& folder) {
  std::size_t count = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    static_cast<void>(entry);
    ++count;
  }
  return count;
}

}  // namespace

TEST_CASE("an upload outlives a daemon that is killed between its pieces, and has the same bytes") {
  const TemporaryFolder folder;
  const std::string data = folder / "data";
  const std::string file = sheet(300);
  const std::size_t third = file.size() / 3;
  std::string upload;
  std::string expected;
  {
    Daemon daemon({"--data", data});
    expected = daemon.upload(file).json()["sha256"];
    upload = begin_upload(daemon, file.size(), "Upload-Metadata: filename c2NhbiBvZiDDti54eXo=,note\r\n");
    const Reply first = patch(daemon, upload, 0, file.substr(0, third));
    REQUIRE(first.status == 204);
    CHECK(first.headers.at("upload-offset") == std::to_string(third));
    CHECK(first.headers.at("upload-expires").find("GMT") != std::string::npos);
    daemon.stop(SIGKILL);
  }
  {
    Daemon daemon({"--data", data});
    CHECK(offset_of(daemon, upload) == std::to_string(third));
    const Reply head = daemon.ask("HEAD", upload, "", kTus);
    CHECK(head.headers.at("upload-length") == std::to_string(file.size()));
    CHECK(head.headers.at("upload-metadata") == "filename c2NhbiBvZiDDti54eXo=,note");
    REQUIRE(patch(daemon, upload, third, file.substr(third, third)).status == 204);
    // This one dies in the middle of a body: whatever came of it counts, and not a byte more.
    RawClient client(daemon.port());
    send_part(client, upload, 2 * third, file.substr(2 * third, 1000), file.size() - 2 * third);
    std::this_thread::sleep_for(std::chrono::milliseconds(200));
    daemon.stop(SIGKILL);
  }
  Daemon daemon({"--data", data});
  const auto offset = static_cast<std::size_t>(std::stoull(offset_of(daemon, upload)));
  CHECK(offset >= 2 * third);
  CHECK(offset <= 2 * third + 1000);
  const Reply early = import_of(daemon, upload);
  CHECK(early.status == 409);
  CHECK(early.json()["limit"] == file.size());
  REQUIRE(patch(daemon, upload, offset, file.substr(offset)).status == 204);
  const Reply cloud = import_of(daemon, upload);
  REQUIRE(cloud.status == 201);
  CHECK(cloud.json()["sha256"] == expected);
  CHECK(cloud.json()["bytes"] == file.size());
  CHECK(cloud.json()["name"] == "scan of \xC3\xB6.xyz");
  CHECK(cloud.headers.at("location") == "/v1/clouds/" + cloud.json()["id"].get<std::string>());
  // It was consumed.
  CHECK(daemon.ask("HEAD", upload, "", kTus).status == 404);
  CHECK(files_in(data + "/uploads") == 0);
  const Reply again = import_of(daemon, upload);
  CHECK(again.status == 422);
  CHECK(again.json()["errors"][0]["pointer"] == "/upload");
}

TEST_CASE("a checksum that does not match leaves the upload where it stood, even where the client vanishes") {
  Daemon daemon;
  const std::string upload = begin_upload(daemon, kText.size());
  const std::string wrong = "Upload-Checksum: sha256 AAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAA=\r\n";
  const std::string right = "Upload-Checksum: sha256 hYqXxlky10COT3iac4go5zLfqlku87Ta0ObxTl0hoOQ=\r\n";
  const Reply refused = patch(daemon, upload, 0, kText, wrong);
  CHECK(refused.status == 460);
  CHECK(refused.json()["type"] == "/problems/checksum-mismatch");
  CHECK(offset_of(daemon, upload) == "0");
  for (const char* bad : {"md5 AAAA", "sha256", "sha256 AA", "sha256 !!!!"})
    CHECK(patch(daemon, upload, 0, kText, std::string("Upload-Checksum: ") + bad + "\r\n").status == 400);
  {
    RawClient client(daemon.port());
    client.send("PATCH " + upload + " HTTP/1.1\r\nHost: localhost\r\n" + at_offset(0) + right +
                "Content-Length: " + std::to_string(kText.size()) + "\r\n\r\n" + kText.substr(0, 5));
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
  }
  Reply done = patch(daemon, upload, 0, kText, right);
  for (int i = 0; i < 200 && done.status == 423; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    done = patch(daemon, upload, 0, kText, right);
  }
  CHECK(done.status == 204);
  CHECK(import_of(daemon, upload).json()["sha256"] == kTextSha256);
  const std::string with_sha1 = begin_upload(daemon, kText.size());
  CHECK(patch(daemon, with_sha1, 0, kText, "Upload-Checksum: sha1 DdYWExbEhzGzBVQn8xPj/3B/Nco=\r\n").status ==
        204);
}

TEST_CASE("of two writers one waits its turn, and what a vanished client sent is kept") {
  Daemon daemon;
  const std::string file = sheet(200);
  const std::string upload = begin_upload(daemon, file.size());
  RawClient first(daemon.port());
  send_part(first, upload, 0, file.substr(0, 4096), file.size());
  Reply second;
  for (int i = 0; i < 200 && second.status != 423; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
    second = patch(daemon, upload, 1, file.substr(1));  // at a wrong offset, so that it can never be taken
  }
  CHECK(second.status == 423);
  CHECK(second.headers.count("retry-after") == 1);
  CHECK(daemon.ask("DELETE", upload, "", kTus).status == 423);
  CHECK(import_of(daemon, upload).status == 423);
  first.close();
  std::string offset = offset_of(daemon, upload);
  for (int i = 0; i < 500 && offset != "4096"; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
    offset = offset_of(daemon, upload);
  }
  CHECK(offset == "4096");
  const Reply elsewhere = patch(daemon, upload, 0, file);
  CHECK(elsewhere.status == 409);
  CHECK(elsewhere.json()["type"] == "/problems/upload-offset");
  CHECK(elsewhere.json()["limit"] == 4096);
  CHECK(patch(daemon, upload, 4096, file).status == 413);
  CHECK(patch(daemon, upload, 4096, file.substr(4096)).status == 204);
  CHECK(import_of(daemon, upload, R"(,"name":"mine","format":"ply")").json()["name"] == "mine");
}

TEST_CASE("what cannot be stored is refused before a byte of it comes, with the numbers") {
  Daemon daemon({"--max-upload-file-bytes", "1099511627776", "--max-uploads", "2"});
  const auto post = [&](const std::string& headers) {
    return daemon.ask("POST", "/v1/uploads", "", headers);
  };
  const Reply full = post(kTus + "Upload-Length: 1099511627776\r\n");
  CHECK(full.status == 507);
  CHECK(full.json()["actual"] == 1099511627776);
  CHECK(full.json()["limit"].get<double>() < 1099511627776.0);
  CHECK(post(kTus + "Upload-Length: 1099511627777\r\n").status == 413);
  for (const char* length :
       {"", "Upload-Length: -1\r\n", "Upload-Length: 1e3\r\n", "Upload-Defer-Length: 1\r\n"})
    CHECK(post(kTus + length).status == 400);
  CHECK(post(kTus + "Upload-Length: 5\r\nUpload-Metadata: filename !\r\n").status == 400);
  CHECK(post(kTus + "Upload-Length: 5\r\nUpload-Metadata: note \xff\r\n").status == 400);
  const std::string one = begin_upload(daemon, 10);
  const std::string two = begin_upload(daemon, 0);
  CHECK(post(kTus + "Upload-Length: 5\r\n").status == 429);
  CHECK(daemon.get("/v1/uploads").json()["uploads"].size() == 2);
  CHECK(daemon.ask("DELETE", one, "", kTus).status == 204);
  CHECK(daemon.ask("DELETE", one, "", kTus).status == 404);
  CHECK(import_of(daemon, two).status == 400);
  CHECK(daemon.ask("HEAD", two, "", kTus).status == 200);
}

TEST_CASE("the protocol's version, extensions and whole small uploads") {
  Daemon daemon;
  const Reply offer = daemon.ask("OPTIONS", "/v1/uploads");
  CHECK(offer.status == 204);
  CHECK(offer.headers.at("tus-version") == "1.0.0");
  CHECK(offer.headers.at("tus-extension") == "creation,creation-with-upload,checksum,termination,expiration");
  CHECK(offer.headers.at("tus-max-size") == "17179869184");
  CHECK(offer.headers.at("tus-checksum-algorithm") == "sha1,sha256");
  for (const std::string version : {"", "Tus-Resumable: 0.2.2\r\n"}) {
    const Reply wrong = daemon.ask("POST", "/v1/uploads", "", version + "Upload-Length: 3\r\n");
    CHECK(wrong.status == 412);
    CHECK(wrong.headers.at("tus-version") == "1.0.0");
  }
  const std::string length = "Upload-Length: " + std::to_string(kText.size()) + "\r\n";
  const Reply whole = daemon.ask("POST", "/v1/uploads", kText, kTus + kBytes + length);
  REQUIRE(whole.status == 201);
  CHECK(whole.headers.at("upload-offset") == std::to_string(kText.size()));
  const Reply shown = daemon.get(whole.headers.at("location"));
  CHECK(shown.json()["offset"] == kText.size());
  CHECK(daemon.ask("POST", "/v1/uploads", kText, kTus + length).status == 415);
  CHECK(daemon.ask("POST", "/v1/uploads", kText + "x", kTus + kBytes + length).status == 413);
  CHECK(import_of(daemon, whole.headers.at("location"), R"(,"format":"las")").status == 422);
  CHECK(import_of(daemon, whole.headers.at("location"), R"(,"format":"e57")").status == 422);
  // It was kept for another try.
  CHECK(import_of(daemon, whole.headers.at("location")).json()["sample_count"] == 3);
}

TEST_CASE("what nobody finishes expires, and leaves nothing behind") {
  const TemporaryFolder folder;
  const std::string data = folder / "data";
  Daemon daemon({"--data", data, "--upload-expiry-s", "1"});
  const std::string upload = begin_upload(daemon, 100);
  REQUIRE(patch(daemon, upload, 0, "half").status == 204);
  for (int i = 0; i < 500 && files_in(data + "/uploads") > 0; ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  CHECK(files_in(data + "/uploads") == 0);
  CHECK(daemon.ask("HEAD", upload, "", kTus).status == 404);
}

TEST_CASE("every format is read by its media type and by its bytes, and says what it was") {
  Daemon daemon;
  const std::string obj =
      "v 500000.123 4649776.456 1\nv 500010.5 4649780.25 2 \nv 500003 4649779 3\nf 1 2 3\n";
  const std::string pcd =
      "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 2\nHEIGHT "
      "1\nPOINTS "
      "2\nDATA ascii\n1 2 3\n4 5 6\n";
  for (const std::string type : {"model/obj", "application/octet-stream"}) {
    const json cloud = daemon.upload(obj, type).json();
    CHECK(cloud["report"]["format"] == "obj");
    CHECK(cloud["report"]["verdict"] == "warnings");
    CHECK(cloud["report"]["warnings"][0] == "left out: 1 faces");
  }
  for (const std::string type : {"model/x-pcd", "application/octet-stream"}) {
    const json cloud = daemon.upload(pcd, type).json();
    CHECK(cloud["report"]["format"] == "pcd");
    CHECK(cloud["report"]["verdict"] == "ok");
    CHECK(cloud["report"]["normals"] == "none");
    CHECK(cloud["report"]["spacing"].get<double>() == doctest::Approx(5.196152422706632));
  }
  const Reply e57 = daemon.upload("ASTM-E57\x01\x00\x00\x00");
  CHECK(e57.status == 415);
  CHECK(e57.json()["detail"].get<std::string>().find("CloudCompare") != std::string::npos);
  const Reply type = daemon.upload("x", "application/vnd.laszip");
  CHECK(type.status == 415);
  CHECK(type.json()["detail"].get<std::string>().find("laszip") != std::string::npos);
}

TEST_CASE("coordinates of a survey come back through every format, through an edit too") {
  Daemon daemon;
  std::string survey = "x y z intensity\n";
  for (int i = 0; i < 30; ++i) {
    for (int j = 0; j < 30; ++j) {
      std::array<char, 96> line{};
      std::snprintf(line.data(), line.size(), "%.3f %.3f %.3f %d\n", 500000.123 + 0.25 * i,
                    4649776.456 + 0.25 * j, 12.5 + 0.001 * ((i * 7 + j * 13) % 11), i);
      survey += line.data();
    }
  }
  const std::string id = daemon.upload(survey, "text/plain").json()["id"];
  const std::string cloud = "/v1/clouds/" + id;
  const auto read_as = [](const Reply& reply, CloudFormat format) {
    REQUIRE(reply.status == 200);
    auto read = read_cloud(std::as_bytes(std::span(reply.body.data(), reply.body.size())), format, {});
    REQUIRE(read.ok());
    return in_caller_order(read.value().cloud);
  };
  const Cloud ply = read_as(daemon.get(cloud + "/data"), CloudFormat::kPly);
  CHECK(model_position(ply, 0) == Vec3d(500000.123, 4649776.456, 12.5));
  const auto same_places = [&](const Cloud& other, double tolerance) {
    REQUIRE(other.size() == ply.size());
    double off = 0.0;
    for (std::size_t i = 0; i < ply.size(); ++i)
      off = std::max(off, (model_position(other, i) - model_position(ply, i)).cwiseAbs().maxCoeff());
    CHECK(off <= tolerance);
  };
  same_places(read_as(daemon.get(cloud + "/data?encoding=ascii"), CloudFormat::kPly), 0.0);
  same_places(read_as(daemon.get(cloud + "/data?format=xyz"), CloudFormat::kXyz), 0.0);
  same_places(read_as(daemon.get(cloud + "/data?format=draco"), CloudFormat::kDraco), 0.0);
  // LAS says scale * integer + offset: a step of float64 beside the decimals.
  same_places(read_as(daemon.get(cloud + "/data", "Accept: application/vnd.las\r\n"), CloudFormat::kLas),
              0x1.0p-30);
  const Cloud bare = read_as(daemon.get(cloud + "/data?attributes="), CloudFormat::kPly);
  CHECK(bare.scalars.empty());
  const Cloud chosen = read_as(daemon.get(cloud + "/data?attributes=intensity"), CloudFormat::kPly);
  CHECK(chosen.scalars.size() == 1);
  const Reply unknown = daemon.get(cloud + "/data?attributes=intensity,nothing");
  CHECK(unknown.status == 422);
  CHECK(unknown.json()["errors"][0]["pointer"] == "?attributes");
  CHECK(daemon.get(cloud + "/data?format=las&encoding=ascii").status == 422);

  // The LAS file is what is edited: what does not move keeps its bits in every format.
  const Reply las = daemon.get(cloud + "/data?format=las");
  const Reply uploaded = daemon.upload(las.body, "application/vnd.las");
  REQUIRE(uploaded.status == 201);
  CHECK(uploaded.json()["report"]["format"] == "las");
  const Cloud before = read_as(las, CloudFormat::kLas);
  const std::string session = daemon.open_session(uploaded.json()["id"], "[0.1]");
  const auto box = [](const char* min, const char* max) {
    return std::string(R"({"mode":"add","shape":{"type":"box","min":[)") + min + R"(],"max":[)" + max + "]}}";
  };
  REQUIRE(
      daemon.ask("POST", session + "/regions/zero/operations", box("499990,4649000,0", "500003,4650000,99"))
          .status == 200);
  REQUIRE(
      daemon.ask("POST", session + "/regions/one/operations", box("500006,4649000,0", "500100,4650000,99"))
          .status == 200);
  REQUIRE(daemon.ask("POST", session + "/edits", translation(0.7512345), "If-Match: *\r\n").status == 201);
  for (const CloudFormat format :
       {CloudFormat::kLas, CloudFormat::kPly, CloudFormat::kXyz, CloudFormat::kDraco}) {
    const std::string name(format_name(format));
    CAPTURE(name);
    const Cloud after = read_as(daemon.get(session + "/samples?attributes=intensity&format=" + name), format);
    REQUIRE(after.size() == before.size());
    std::size_t kept = 0;
    double highest = 0.0;
    for (std::size_t i = 0; i < before.size(); ++i) {
      const Vec3d was = model_position(before, i);
      if (was.x() < 500003) kept += model_position(after, i) == was ? 1 : 0;
      highest = std::max(highest, model_position(after, i).z());
    }
    CHECK(kept == 360);
    CHECK(highest > 13.2);
    CHECK(after.scalars.size() == 1);
  }
  const Cloud detailed =
      read_as(daemon.get(session + "/samples?attributes=normal,detail"), CloudFormat::kPly);
  CHECK(detailed.has_normals());
  REQUIRE(detailed.scalars.size() == 1);
  CHECK(detailed.scalars[0].name == "detail");
}

// Dynamic resampling through the real daemon: stretched, exported, undone, replayed elsewhere.

#include <doctest/doctest.h>

#include <cmath>
#include <set>

#include "tests/acceptance/bodies.h"
#include "tests/acceptance/daemon.h"
#include "tests/acceptance/stream_reader.h"

using namespace pointwright;
using namespace pointwright::test;
using nlohmann::json;

namespace {

const std::string kAny = "If-Match: *\r\n";
const std::string kScales = "[0.08]";

/// Pulls the right end of the sheet along x: what is between the regions gets several times as long.
std::string pull(double x, const std::string& resampling, const std::string& more = "") {
  return R"({"level":0,"deformation":{"type":"translation","vector":[)" + std::to_string(x) +
         R"(,0,0]},"resampling":)" + resampling + more + "}";
}

std::string painted_session(Daemon& daemon, const std::string& cloud) {
  const std::string session = daemon.open_session(cloud, kScales);
  for (const auto& [region, operation] : {std::pair("zero", kLeft), std::pair("one", kRight)})
    REQUIRE(
        daemon.ask("PUT", session + "/regions/" + region, R"({"operations":[)" + operation + "]}").status ==
        200);
  return session;
}

json recorded(Daemon& daemon, const std::string& session, const std::string& body) {
  const Reply reply = daemon.ask("POST", session + "/edits", body, kAny);
  REQUIRE_MESSAGE(reply.status == 201, reply.body);
  return reply.json();
}

std::string samples(Daemon& daemon, const std::string& session, const std::string& query = "") {
  const Reply reply = daemon.get(session + "/samples?format=ply" + query);
  REQUIRE_MESSAGE(reply.status == 200, reply.body);
  return reply.body;
}

void move_head(Daemon& daemon, const std::string& session, std::size_t edit) {
  const Reply reply = daemon.ask("PUT", session + "/head", json{{"edit", edit}}.dump());
  REQUIRE_MESSAGE(reply.status == 200, reply.body);
  CHECK(reply.json()["history"]["head"] == edit);
}

/// The greatest distance along x, among samples near the middle line, to the next one.
double widest_gap(const Cloud& cloud) {
  std::set<double> places;
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const Vec3d p = model_position(cloud, i);
    if (std::abs(p.y() - 0.5) < 0.05) places.insert(p.x());
  }
  double widest = 0.0;
  for (auto place = std::next(places.begin()); place != places.end(); ++place)
    widest = std::max(widest, *place - *std::prev(place));
  return widest;
}

}  // namespace

TEST_CASE("downloads say along which direction the surface is stretched") {
  Daemon daemon;
  const std::string cloud = daemon.upload(file_of(wavy_sheet(40)), "application/x-ply").json()["id"];
  const std::string session = painted_session(daemon, cloud);
  const auto columns = [&](const std::string& format) {
    const std::string query = "&attributes=stretch,stretch_x,stretch_y,stretch_z";
    const Reply reply = daemon.get(session + "/samples?format=" + format + query);
    REQUIRE_MESSAGE(reply.status == 200, reply.body);
    return reply.body;
  };
  const auto each = [](const std::string& file, auto visit) {
    const Cloud measured_cloud = cloud_of(file);
    REQUIRE(measured_cloud.scalars.size() == 4);
    const auto value = [&](std::size_t k, std::size_t i) {
      return double{std::get<std::vector<float>>(measured_cloud.scalars[k].values)[i]};
    };
    for (std::size_t i = 0; i < measured_cloud.size(); ++i)
      visit(value(0, i), Vec3d(value(1, i), value(2, i), value(3, i)));
  };
  each(columns("ply"), [](double, const Vec3d& direction) { CHECK(direction == Vec3d::Zero()); });
  // Too coarse a spacing to insert anything: the cells stay as the pull along x leaves them.
  const json record = recorded(daemon, session, pull(2.0, R"({"bound":1.5,"min_spacing":10})"));
  CHECK(record["inserted"] == 0);
  std::size_t pulled = 0;
  each(columns("ply"), [&](double stretch, const Vec3d& direction) {
    if (stretch < 2.0) return;
    ++pulled;
    CHECK(direction.norm() == doctest::Approx(1.0).epsilon(1e-5));
    CHECK(direction.x() > 0.85);
  });
  CHECK(pulled > 300);
  for (const char* format : {"draco", "las"}) CHECK_FALSE(columns(format).empty());
  CHECK(daemon.get(session + "/samples?format=ply&attributes=stretch_w").status == 422);
}

TEST_CASE("a stretched sheet gets samples, and undo, redo and a recipe give the same bytes") {
  const std::string file = file_of(wavy_sheet(40));
  std::string recipe;
  std::string stretched;
  std::string part;
  for (const char* threads : {"1", "2"}) {
    Daemon daemon({"--threads", threads});
    const std::string cloud = daemon.upload(file, "application/x-ply").json()["id"];
    const std::string session = painted_session(daemon, cloud);
    const std::string rest = samples(daemon, session);
    const json plain =
        recorded(daemon, session, R"({"level":0,"deformation":{"type":"translation","vector":[2,0,0]}})");
    CHECK(plain["inserted"] == 0);
    CHECK(plain["sample_count"] == 1600);
    const double gap = widest_gap(cloud_of(samples(daemon, session)));
    move_head(daemon, session, 0);

    const json record = recorded(daemon, session, pull(2.0, R"({"bound":1.5})"));
    const auto inserted = record["inserted"].get<std::size_t>();
    CHECK(inserted > 500);
    CHECK(record["removed"] == 0);
    CHECK(record["sample_count"] == 1600 + inserted);
    CHECK(record["edit"]["resampling"]["sweeps"] == 8);
    CHECK(daemon.get(session).json()["sample_count"] == 1600 + inserted);
    const std::string once = samples(daemon, session);
    const Cloud now = cloud_of(once);
    REQUIRE(now.size() == 1600 + inserted);
    CHECK(now.color.size() == now.size());
    CHECK(widest_gap(now) < 0.5 * gap);
    const Cloud measured = cloud_of(
        daemon.get(session + "/samples?format=ply&attributes=stretch,minor_stretch,anisotropy,area_change")
            .body);
    REQUIRE(measured.scalars.size() == 4);
    const auto column = [&](std::size_t i) {
      return std::get<std::vector<float>>(measured.scalars[i].values);
    };
    for (std::size_t i = 0; i < measured.size(); i += 97) {
      CHECK(column(0)[i] >= column(1)[i]);
      CHECK(column(2)[i] == doctest::Approx(double{column(0)[i]} / double{column(1)[i]}).epsilon(1e-5));
      CHECK(column(3)[i] == doctest::Approx(double{column(0)[i]} * double{column(1)[i]}).epsilon(1e-5));
    }
    // The uploaded samples come first, in the caller's order; those of the zero-region have not moved.
    const Cloud before = cloud_of(rest);
    std::size_t unmoved = 0;
    for (std::size_t i = 0; i < 1600; ++i)
      if (model_position(before, i).x() < 0.2 && model_position(now, i) == model_position(before, i))
        ++unmoved;
    CHECK(unmoved >= 320);
    CHECK(daemon.get(session + "/samples?format=draco").status == 200);
    CHECK(daemon.get(session + "/samples?format=xyz").status == 200);

    recorded(daemon, session, R"({"level":1,"deformation":{"type":"along_normal","distance":0.02}})");
    const json turned = recorded(
        daemon, session,
        R"({"level":0,"deformation":{"type":"rotation","angle_deg":120,"axis":{"point":[0.5,0.5,0],"direction":[0,1,0]}},"resampling":{"collect":0.7,"min_spacing":0.01}})");
    CHECK(turned["sample_count"] == daemon.get(session).json()["sample_count"]);
    const std::string last = samples(daemon, session);
    move_head(daemon, session, 1);
    CHECK(samples(daemon, session) == once);
    move_head(daemon, session, 0);
    CHECK(samples(daemon, session) == rest);
    CHECK(daemon.get(session).json()["sample_count"] == 1600);
    move_head(daemon, session, 3);
    CHECK(samples(daemon, session) == last);
    CHECK(samples(daemon, session, "&s=0") == rest);
    CHECK(samples(daemon, session, "&s=1&timing=together") == last);
    const std::string half = samples(daemon, session, "&s=0.5&timing=together");
    CHECK(cloud_of(half).size() < cloud_of(last).size());
    CHECK(cloud_of(half).size() > 1600);

    const std::string text = daemon.get(session + "/recipe").body;
    const std::string fresh = daemon.open_session(cloud, kScales);
    const Reply applied = daemon.ask("POST", fresh + "/recipe", R"({"recipe":)" + text + "}", kAny);
    REQUIRE_MESSAGE(applied.status == 200, applied.body);
    CHECK(samples(daemon, fresh) == last);
    CHECK(samples(daemon, fresh, "&level=0") == samples(daemon, session, "&level=0"));
    CHECK(daemon.get(fresh + "/recipe").body == text);
    const std::string third = daemon.open_session(cloud, kScales);
    REQUIRE(
        daemon
            .ask("POST", third + "/recipe", R"({"recipe":)" + text + R"(,"s":0.5,"timing":"together"})", kAny)
            .status == 200);
    CHECK(samples(daemon, third) == half);
    // The number of threads changes nothing.
    if (recipe.empty()) {
      recipe = text;
      stretched = last;
      part = half;
    }
    CHECK(recipe == text);
    CHECK(stretched == last);
    CHECK(part == half);
  }
}

TEST_CASE("a stream follows a drag whose samples become more and fewer") {
  Daemon daemon;
  const std::string cloud = daemon.upload(file_of(wavy_sheet(40)), "application/x-ply").json()["id"];
  const std::string session = painted_session(daemon, cloud);
  StreamReader stream(daemon, session + "/stream?attributes=normal,t,detail,marks,radius");
  auto frame = stream.next_frame();
  std::uint64_t sequence = 0;
  std::set<std::uint32_t> counts;
  for (const double x : {0.5, 1.0, 2.0, 1.0, 0.0}) {
    std::string body = pull(x, R"({"bound":1.5})");
    body.insert(1, R"("sequence":)" + std::to_string(++sequence) + ",");
    const Reply shown = daemon.ask("PUT", session + "/preview", body);
    REQUIRE_MESSAGE(shown.status == 204, shown.body);
    while (frame && frame->header.sequence != sequence) frame = stream.next_frame();
    REQUIRE(frame.has_value());
    if (x == 0.0) {
      CHECK(frame->header.sample_count == 1600);
      continue;
    }
    CHECK(frame->header.kind == protocol::FrameKind::kKey);
    CHECK(frame->header.sample_count > 1600);
    CHECK(frame->header.stretch_range >= 1.0F);
    counts.insert(frame->header.sample_count);
  }
  CHECK(counts.size() == 3);
  REQUIRE(daemon.ask("DELETE", session + "/preview").status == 204);
  while (frame && frame->header.sequence != 0) frame = stream.next_frame();
  REQUIRE(frame.has_value());
  CHECK(frame->header.sample_count == 1600);
  const json record = recorded(daemon, session, pull(2.0, "{}"));
  while (frame && frame->header.sample_count == 1600) frame = stream.next_frame();
  REQUIRE(frame.has_value());
  CHECK(frame->header.sample_count == record["sample_count"]);
}

TEST_CASE("what resampling is refused for, by the edit's limit, the session's and the memory") {
  const std::string file = file_of(wavy_sheet(40));
  const auto refused = [](Daemon& daemon, const std::string& session, const std::string& body) {
    const Reply reply = daemon.ask("POST", session + "/edits", body, kAny);
    CHECK_MESSAGE(reply.status == 413, reply.body);
    CHECK(reply.json()["type"] == "/problems/limit-exceeded");
    CHECK(reply.json()["errors"][0]["pointer"] == "/resampling/max_samples");
    CHECK(reply.json()["actual"].get<double>() > reply.json()["limit"].get<double>());
    CHECK(daemon.get(session).json()["sample_count"] == 1600);
    return reply.json()["limit"].get<double>();
  };
  {
    Daemon daemon({"--max-session-samples", "1700"});
    CHECK(daemon.get("/v1/info").json()["limits"]["max_session_samples"] == 1700);
    const std::string cloud = daemon.upload(file, "application/x-ply").json()["id"];
    const std::string session = painted_session(daemon, cloud);
    CHECK(refused(daemon, session, pull(2.0, "{}")) == 1700.0);
    CHECK(refused(daemon, session, pull(2.0, R"({"max_samples":1650})")) == 1650.0);
    CHECK(refused(daemon, session, pull(2.0, R"({"max_samples":999999})")) == 1700.0);
    const Reply invalid = daemon.ask("POST", session + "/edits", pull(2.0, R"({"bound":1})"), kAny);
    CHECK(invalid.status == 422);
    CHECK(invalid.json()["errors"][0]["pointer"] == "/resampling/bound");
    const json recipe = {{"format", "pointwright-recipe"},
                         {"version", 1},
                         {"level_scales", daemon.get(session + "/recipe").json()["level_scales"]},
                         {"edits", {json::parse(pull(2.0, "{}"))}}};
    json painted = recipe;
    painted["edits"][0]["zero"] = {{"operations", {json::parse(kLeft)}}};
    painted["edits"][0]["one"] = {{"operations", {json::parse(kRight)}}};
    const Reply applied =
        daemon.ask("POST", session + "/recipe", R"({"recipe":)" + painted.dump() + "}", kAny);
    CHECK(applied.status == 413);
    CHECK(applied.json()["errors"][0]["pointer"] == "/recipe/edits/0/resampling/max_samples");
  }
  {
    // Room for one session of this cloud, and not for twice as many samples.
    Daemon daemon({"--max-session-bytes", "4500000", "--history-bytes", "2000000"});
    const std::string cloud = daemon.upload(file, "application/x-ply").json()["id"];
    const std::string session = painted_session(daemon, cloud);
    CHECK(refused(daemon, session, pull(40.0, "{}")) >= 1600.0);
    CHECK(recorded(daemon, session, pull(0.25, "{}"))["inserted"].get<int>() > 0);
  }
}

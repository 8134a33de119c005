// Jobs through the real daemon, each in a worker process of its own.

#include <doctest/doctest.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <thread>

#include "server/store/upload_store.h"
#include "tests/acceptance/bodies.h"
#include "tests/acceptance/daemon.h"
#include "tests/server/raw_client.h"

using namespace pointwright;
using namespace pointwright::test;
using nlohmann::json;

namespace {

bool becomes(const std::function<bool()>& is_so, std::chrono::seconds patience = std::chrono::seconds(60)) {
  const auto end = std::chrono::steady_clock::now() + patience;
  while (std::chrono::steady_clock::now() < end) {
    if (is_so()) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  return false;
}

json submit(Daemon& daemon, const json& body, const std::string& headers = "") {
  const Reply reply = daemon.ask("POST", "/v1/jobs", body.dump(), headers);
  REQUIRE_MESSAGE(reply.status == 202, reply.body);
  CHECK(reply.headers.at("location") == "/v1/jobs/" + reply.json()["jobID"].get<std::string>());
  return reply.json();
}

std::string path_of(const json& job) {
  return "/v1/jobs/" + job["jobID"].get<std::string>();
}

std::string status_of(Daemon& daemon, const json& job) {
  return daemon.get(path_of(job)).json().value("status", "gone");
}

json ended(Daemon& daemon, const json& job) {
  json document;
  REQUIRE(becomes([&] {
    document = daemon.get(path_of(job)).json();
    const std::string status = document.value("status", "");
    return status != "accepted" && status != "running" && !status.empty();
  }));
  return document;
}

json done(Daemon& daemon, const json& job) {
  const json document = ended(daemon, job);
  REQUIRE_MESSAGE(document["status"] == "successful",
                  (document.dump() + "\n" + daemon.get(path_of(job) + "/log").body));
  return document;
}

/// A file that was uploaded in pieces, and its id.
std::string resumable(Daemon& daemon, const std::string& bytes) {
  const std::string tus = "Tus-Resumable: 1.0.0\r\n";
  const Reply made =
      daemon.ask("POST", "/v1/uploads", "", tus + "Upload-Length: " + std::to_string(bytes.size()) + "\r\n");
  REQUIRE_MESSAGE(made.status == 201, made.body);
  const std::string path = made.headers.at("location");
  const Reply sent = daemon.ask(
      "PATCH", path, bytes, tus + "Upload-Offset: 0\r\nContent-Type: application/offset+octet-stream\r\n");
  REQUIRE_MESSAGE(sent.status == 204, sent.body);
  return path.substr(path.rfind('/') + 1);
}

/// A session on a preview of a sheet, its right end lifted.
struct Lifted {
  std::string file;
  std::string cloud;
  std::string session;  ///< its id

  explicit Lifted(Daemon& daemon, std::size_t side = 100) : file(file_of(wavy_sheet(side))) {
    cloud = daemon.upload(file, "application/x-ply").json()["id"];
    const Reply made =
        daemon.ask("POST", "/v1/sessions",
                   json{{"cloud", cloud}, {"scales", {0.08, 0.03}}, {"preview", {{"count", 2500}}}}.dump());
    REQUIRE_MESSAGE(made.status == 202, made.body);
    session = made.json()["id"];
    const std::string path = "/v1/sessions/" + session;
    REQUIRE(becomes([&] { return daemon.get(path).json()["state"] == "ready"; }));
    for (const auto& [region, operation] : {std::pair{"/regions/zero", kLeft}, {"/regions/one", kRight}})
      REQUIRE(daemon.ask("PUT", path + region, R"({"operations":[)" + operation + "]}").status == 200);
    REQUIRE(daemon.ask("POST", path + "/edits", translation(0.3), "If-Match: *\r\n").status == 201);
  }
  [[nodiscard]] json recipe(Daemon& daemon) const {
    return daemon.get("/v1/sessions/" + session + "/recipe").json();
  }
};

/// A launcher that holds its workers until let go.
struct Held {
  TemporaryFolder folder;
  std::string script = folder / "hold.sh";
  std::string gate = folder / "gate";

  Held() { std::ofstream(script) << "while [ ! -e " << gate << " ]; do sleep 0.02; done\nexec \"$@\"\n"; }
  [[nodiscard]] std::vector<std::string> arguments(std::vector<std::string> more = {}) const {
    more.insert(more.end(), {"--launcher", "held=sh " + script + " {worker}"});
    return more;
  }
  void let_go() const { std::ofstream(gate) << "go"; }
};

}  // namespace

TEST_CASE("a session's edits are made on the whole of its cloud, with the report and the log") {
  const TemporaryFolder folder;
  Daemon daemon({"--data", folder / "data"});
  const Lifted lifted(daemon);
  const json job = submit(daemon, {{"session", lifted.session}, {"name", "The sheet"}, {"priority", 9}});
  CHECK(job["type"] == "process");
  CHECK(job["request"]["cloud"] == lifted.cloud);
  CHECK(job["request"]["output"]["format"] == "ply");
  const json document = done(daemon, job);
  CHECK(document["progress"] == 100);
  CHECK(document["attempts"] == 1);
  CHECK(document.contains("started"));
  CHECK(document.contains("finished"));
  const json report = document["report"];
  CHECK(report["mode"] == "tiles");
  CHECK(report["sample_count"] == 10000);
  CHECK(report["preview"]["matched"] == 2500);
  CHECK(report["preview"]["rms_difference"].get<double>() < 0.2 * report["spacing"].get<double>());

  const json results = daemon.get(path_of(job) + "/results").json();
  REQUIRE(results["results"].size() == 1);
  const json result = results["results"][0];
  CHECK(result["href"] == path_of(job) + "/results/result.ply");
  const Reply file = daemon.get(result["href"]);
  REQUIRE(file.status == 200);
  CHECK(file.body.size() == result["bytes"]);
  CHECK(file.headers.at("content-type") == "application/x-ply");
  CHECK(file.headers.at("content-disposition").find("The-sheet.ply") != std::string::npos);
  CHECK(daemon.get(result["href"], "If-None-Match: " + file.headers.at("etag") + "\r\n").status == 304);
  CHECK(daemon.get(path_of(job) + "/results/log").status == 404);
  CHECK(daemon.get(path_of(job) + "/results/recipe.json").status == 404);

  const Cloud before = cloud_of(lifted.file);
  const Cloud after = cloud_of(file.body);
  REQUIRE(after.size() == before.size());
  std::size_t moved = 0;
  for (std::size_t i = 0; i < before.size(); ++i) {
    const Vec3d rest = model_position(before, i);
    const Vec3d now = model_position(after, i);
    if (rest.x() < 0.15) CHECK(now == rest);
    if (rest.x() > 0.85) CHECK(now.z() - rest.z() == doctest::Approx(0.3).epsilon(0.02));
    if (now != rest) ++moved;
  }
  CHECK(moved == report["moved"]);

  const std::string log = daemon.get(path_of(job) + "/log").body;
  CHECK(log.find("attempt 1, launcher local") != std::string::npos);
  CHECK(log.find(folder / "data") == std::string::npos);
  CHECK(log.find("successful") != std::string::npos);
  CHECK(daemon.get(path_of(job) + "/log?offset=" + std::to_string(log.size())).body.empty());
  CHECK(daemon.get(path_of(job) + "/log?offset=10").body == log.substr(10));
  const std::string events = daemon.get(path_of(job) + "/events").body;
  CHECK(events.find("event: job\n") != std::string::npos);
  CHECK(events.find(R"("status":"successful")") != std::string::npos);

  CHECK(daemon.get("/v1/jobs").json()["jobs"].size() == 1);
  CHECK(daemon.get("/v1/jobs?status=failed").json()["jobs"].empty());
  CHECK(daemon.get("/v1/jobs?status=done").status == 422);
  CHECK(daemon.ask("POST", path_of(job) + "/restart").status == 409);
  // What the disk has lost is told, not sent as nothing, nor a part of it as the whole.
  const std::string kept = (folder / "data/jobs/") + job["jobID"].get<std::string>() + "/result.ply";
  const std::string request =
      "GET " + result["href"].get<std::string>() + " HTTP/1.1\r\nHost: localhost\r\n\r\n";
  CHECK(exchange(daemon.port(), request).ends_with("\r\n0\r\n\r\n"));
  std::filesystem::resize_file(kept, 1000);
  const std::string part = exchange(daemon.port(), request);
  CHECK(part.starts_with("HTTP/1.1 200"));
  CHECK_FALSE(part.ends_with("\r\n0\r\n\r\n"));
  std::filesystem::remove(kept);
  CHECK(daemon.get(result["href"]).status == 500);

  CHECK(daemon.ask("DELETE", path_of(job)).status == 200);
  CHECK(daemon.get(path_of(job)).status == 404);
  CHECK(std::filesystem::is_empty(folder / "data/jobs"));
  CHECK(daemon.get("/v1/clouds/" + lifted.cloud).status == 200);
}

TEST_CASE("a recipe is made on an upload as it came, with a preview of its own or a cloud's, in every mode") {
  Daemon daemon;
  const Lifted lifted(daemon);
  const json recipe = lifted.recipe(daemon);
  const std::string upload = resumable(daemon, lifted.file);
  std::vector<std::string> files;
  for (json body : {json{{"preview", {{"count", 2500}}}}, json{{"preview", {{"cloud", lifted.cloud}}}},
                    json{{"mode", "memory"}}, json{{"mode", "direct"}}, json{{"output", {{"format", "xyz"}}}},
                    json{{"s", 0.0}}}) {
    body["recipe"] = recipe;
    body["upload"] = upload;
    const json document = done(daemon, submit(daemon, body));
    CHECK(document["report"]["mode"] == body.value("mode", body.contains("output") ? "memory" : "tiles"));
    const json result = daemon.get(path_of(document) + "/results").json()["results"][0];
    files.push_back(daemon.get(result["href"]).body);
  }
  CHECK(files[5] == lifted.file);  // nothing of the recipe: the bytes that came
  CHECK(files[4].find("ply") == std::string::npos);
  CHECK(files[4].size() > 10000);
  CHECK(daemon.ask("HEAD", "/v1/uploads/" + upload, "", "Tus-Resumable: 1.0.0\r\n").status == 200);
}

TEST_CASE("an animation is one job with many results") {
  Daemon daemon;
  const Lifted lifted(daemon);
  const json job = done(daemon, submit(daemon, {{"session", lifted.session}, {"output", {{"steps", 3}}}}));
  CHECK(job["request"]["output"] == json{{"format", "ply"}, {"steps", 3}});
  CHECK_FALSE(job["report"].contains("files"));
  const json results = daemon.get(path_of(job) + "/results").json()["results"];
  REQUIRE(results.size() == 3);
  CHECK(results[2]["name"] == "result_0003.ply");
  const Reply first = daemon.get(results[0]["href"]);
  CHECK(first.body == lifted.file);  // s = 0
  CHECK(first.headers.at("content-disposition") == "attachment; filename=\"result_0001.ply\"");
  const json plain = done(daemon, submit(daemon, {{"session", lifted.session}}));
  CHECK(daemon.get(results[2]["href"]).body == daemon.get(path_of(plain) + "/results/result.ply").body);
}

TEST_CASE("jobs go by priority; one that is dismissed ends at once, and goes on when it is started again") {
  const TemporaryFolder folder;
  const Held held;
  Daemon daemon(held.arguments({"--data", folder / "data"}));
  const Lifted lifted(daemon);
  const auto begin = [&](int priority) {
    return submit(daemon, {{"session", lifted.session}, {"launcher", "held"}, {"priority", priority}});
  };
  const json first = begin(5);
  REQUIRE(becomes([&] { return status_of(daemon, first) == "running"; }));
  const json low = begin(1);
  const json middle = begin(5);
  const json high = begin(8);
  CHECK(daemon.get(path_of(high)).json()["queue_place"] == 1);
  CHECK(daemon.get(path_of(middle)).json()["queue_place"] == 2);
  CHECK(daemon.get(path_of(low)).json()["queue_place"] == 3);
  CHECK(daemon.get(path_of(first) + "/results").status == 409);

  const Reply early = daemon.ask("DELETE", path_of(middle) + "?only=forget");
  CHECK(early.status == 409);
  CHECK(early.json()["type"] == "/problems/wrong-state");
  CHECK(daemon.ask("DELETE", path_of(middle) + "?only=both").status == 422);
  CHECK(status_of(daemon, middle) == "accepted");
  const json dismissed = daemon.ask("DELETE", path_of(middle) + "?only=dismiss").json();
  CHECK(dismissed["status"] == "dismissed");
  const auto before = std::chrono::steady_clock::now();
  CHECK(daemon.ask("DELETE", path_of(first)).json()["status"] == "dismissed");
  CHECK(becomes([&] { return status_of(daemon, high) == "running"; }, std::chrono::seconds(5)));
  CHECK(std::chrono::steady_clock::now() - before < std::chrono::seconds(2));
  CHECK(status_of(daemon, low) == "accepted");

  held.let_go();
  done(daemon, high);
  done(daemon, low);
  // Dismissed as it ended: it keeps its results.
  CHECK(daemon.ask("DELETE", path_of(low) + "?only=dismiss").status == 409);
  CHECK(daemon.get(path_of(low) + "/results").status == 200);
  CHECK(daemon.ask("DELETE", path_of(low) + "?only=forget").status == 200);
  CHECK(daemon.get(path_of(low)).status == 404);
  CHECK(status_of(daemon, first) == "dismissed");
  const Reply again = daemon.ask("POST", path_of(first) + "/restart");
  CHECK(again.status == 202);
  CHECK(again.json()["status"] == "accepted");
  done(daemon, first);
  CHECK(status_of(daemon, middle) == "dismissed");
}

TEST_CASE("after kill -9 a job that ran goes on, one that waited waits, and no worker is left behind") {
  const TemporaryFolder folder;
  const Held held;
  const std::vector<std::string> arguments = held.arguments({"--data", folder / "data"});
  json running;
  json waiting;
  json finished;
  std::string bytes;
  pid_t worker = 0;
  {
    Daemon daemon(arguments);
    const Lifted lifted(daemon);
    finished = done(daemon, submit(daemon, {{"session", lifted.session}}));
    bytes = daemon.get(path_of(finished) + "/results/result.ply").body;
    running = submit(daemon, {{"session", lifted.session}, {"launcher", "held"}});
    REQUIRE(becomes([&] { return status_of(daemon, running) == "running"; }));
    waiting = submit(daemon, {{"session", lifted.session}}, "Idempotency-Key: once\r\n");
    const json same = submit(daemon, {{"session", lifted.session}}, "Idempotency-Key: once\r\n");
    CHECK(same["jobID"] == waiting["jobID"]);
    const std::string pid_file = folder / "data/jobs/" + running["jobID"].get<std::string>() + "/worker.pid";
    REQUIRE(becomes([&] { return static_cast<bool>(std::ifstream(pid_file) >> worker) && worker > 1; }));
    daemon.stop(SIGKILL);
    CHECK(::kill(worker, 0) == 0);  // nobody has ended it
  }
  // Ended between what it keeps of the job and what it removes of it.
  const std::string input =
      folder / "data/jobs/" + finished["jobID"].get<std::string>() + "/" + server::kJobInputName;
  CHECK_FALSE(std::filesystem::exists(input));
  std::ofstream(input) << "left";
  Daemon daemon(arguments);
  CHECK(becomes([&] { return ::kill(worker, 0) != 0; }, std::chrono::seconds(5)));
  CHECK_FALSE(std::filesystem::exists(input));
  CHECK(daemon.get(path_of(finished)).json()["report"] == finished["report"]);
  CHECK(daemon.get(path_of(finished) + "/results/result.ply").body == bytes);
  CHECK(becomes([&] { return status_of(daemon, running) == "running"; }));
  CHECK(status_of(daemon, waiting) == "accepted");
  held.let_go();
  const json document = done(daemon, running);
  CHECK(document["attempts"] == 2);
  CHECK(daemon.get(path_of(running) + "/results/result.ply").body == bytes);
  done(daemon, waiting);
  CHECK(daemon.get("/v1/jobs").json()["jobs"].size() == 3);
}

TEST_CASE("a daemon that is told to stop ends its worker in time; the next one goes on with the job") {
  const TemporaryFolder folder;
  const Held held;
  const std::vector<std::string> arguments = held.arguments({"--data", folder / "data"});
  json job;
  {
    Daemon daemon(arguments);
    const Lifted lifted(daemon);
    job = submit(daemon, {{"session", lifted.session}, {"launcher", "held"}});
    REQUIRE(becomes([&] { return status_of(daemon, job) == "running"; }));
    CHECK(daemon.stop(SIGTERM, std::chrono::seconds(10)) == 0);
  }
  held.let_go();
  Daemon daemon(arguments);
  CHECK(done(daemon, job)["attempts"] == 2);
}

TEST_CASE("the workers of a daemon that MPI or Slurm has started are no processes of its team") {
  const TemporaryFolder folder;
  std::ofstream(folder / "tell.sh") << "env >&2; exit 7\n";
  Daemon daemon({"--launcher", "tell=sh " + (folder / "tell.sh") + " {worker}"},
                {"OMPI_COMM_WORLD_SIZE=2", "PMI_SIZE=2", "SLURM_STEP_NUM_TASKS=2", "SLURM_JOB_ID=1234"});
  const Lifted lifted(daemon);
  const json told = ended(daemon, submit(daemon, {{"session", lifted.session}, {"launcher", "tell"}}));
  const std::string log = daemon.get(path_of(told) + "/log").body;
  CHECK(log.find("SLURM_JOB_ID=1234") != std::string::npos);  // what srun goes by stays
  for (const char* const name : {"OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "SLURM_STEP_NUM_TASKS"})
    CHECK(log.find(std::string(name) + "=") == std::string::npos);
}

TEST_CASE("a worker that dies fails its job with a plain reason, and nothing else") {
  const TemporaryFolder folder;
  const auto launcher = [&](const std::string& name, const std::string& text) {
    std::ofstream(folder / (name + ".sh")) << text;
    return name + "=sh " + (folder / (name + ".sh")) + " {worker}";
  };
  Daemon daemon({"--launcher", launcher("killed", "kill -9 $$\n"), "--launcher",
                 launcher("crashed", "kill -SEGV $$\n"), "--launcher",
                 launcher("gone", "echo words for the log >&2; exit 7\n"), "--launcher",
                 "nothing=/nonexistent/program {worker}", "--max-job-bytes", "67108864"});
  const Lifted lifted(daemon, 160);
  const auto failed = [&](json body) {
    body["session"] = lifted.session;
    const json document = ended(daemon, submit(daemon, body));
    CHECK(document["status"] == "failed");
    CHECK(document["exception"]["detail"] == document["message"]);
    return document;
  };
  CHECK(failed({{"launcher", "killed"}})["message"].get<std::string>().find("memory") != std::string::npos);
  CHECK(failed({{"launcher", "crashed"}})["message"].get<std::string>().find("Segmentation") !=
        std::string::npos);
  const json gone = failed({{"launcher", "gone"}});
  CHECK(gone["message"].get<std::string>().find("status 7") != std::string::npos);
  CHECK(daemon.get(path_of(gone) + "/log").body.find("words for the log") != std::string::npos);
  CHECK(failed({{"launcher", "nothing"}})["message"].get<std::string>().find("launcher nothing") !=
        std::string::npos);
  CHECK(daemon.is_alive());
  // Not a cloud at all: the worker says so itself.
  const std::string upload = resumable(daemon, "ply\nformat binary_little_endian 1.0\nelement vertex 9\n");
  const json malformed = failed({{"upload", upload}});
  CHECK(malformed["exception"]["type"] == "/problems/malformed-cloud");
  // What is there still works.
  CHECK(done(daemon, submit(daemon, {{"session", lifted.session}}))["report"]["sample_count"] == 25600);
}

TEST_CASE("validate says what a job would take, and leaves nothing") {
  const TemporaryFolder folder;
  Daemon daemon({"--data", folder / "data"});
  const Lifted lifted(daemon);
  const auto estimate = [&](json body) {
    body["validate"] = true;
    body["session"] = lifted.session;
    const Reply reply = daemon.ask("POST", "/v1/jobs", body.dump());
    REQUIRE_MESSAGE(reply.status == 200, reply.body);
    return reply.json()["estimate"];
  };
  const json tiles = estimate({});
  CHECK(tiles["mode"] == "tiles");
  CHECK(tiles["sample_count"] == 10000);
  CHECK(tiles["disk_bytes"].get<std::uint64_t>() >= lifted.file.size());
  CHECK(tiles["seconds"].get<double>() > 0.0);
  CHECK(tiles["free_disk_bytes"].get<std::uint64_t>() > 0);
  CHECK(estimate({{"mode", "memory"}})["mode"] == "memory");
  CHECK(daemon.get("/v1/jobs").json()["jobs"].empty());
  CHECK(std::filesystem::is_empty(folder / "data/jobs"));
  // What the worker refuses is an answer, not a job.
  const std::string upload = resumable(daemon, "ply\nformat binary_little_endian 1.0\nelement vertex 9\n");
  const Reply refused = daemon.ask(
      "POST", "/v1/jobs", json{{"session", lifted.session}, {"upload", upload}, {"validate", true}}.dump());
  CHECK(refused.status == 422);
}

TEST_CASE("a job that cannot be is refused with what is wrong; as many as may be are taken") {
  const Held held;
  Daemon daemon(held.arguments({"--max-jobs", "2", "--job-retention-s", "1"}));
  const Lifted lifted(daemon);
  const json recipe = lifted.recipe(daemon);
  const auto refused = [&](const json& body, const std::string& pointer) {
    const Reply reply = daemon.ask("POST", "/v1/jobs", body.dump());
    CAPTURE(reply.body);
    CHECK(reply.status == 422);
    const json errors = reply.json()["errors"];
    REQUIRE(!errors.empty());
    CHECK(errors[0]["pointer"] == pointer);
  };
  const std::string nothing = "AAAAAAAAAAAAAAAAAAAAAA";
  refused({{"cloud", lifted.cloud}}, "/recipe");
  refused({{"cloud", lifted.cloud}, {"session", lifted.session}, {"recipe", recipe}}, "/recipe");
  refused({{"recipe", recipe}}, "/cloud");
  refused({{"recipe", recipe}, {"cloud", nothing}}, "/cloud");
  refused({{"recipe", recipe}, {"upload", nothing}}, "/upload");
  refused({{"session", nothing}}, "/session");
  refused({{"session", lifted.session}, {"launcher", "mpirun"}}, "/launcher");
  refused({{"session", lifted.session}, {"mode", "fast"}}, "/mode");
  refused({{"session", lifted.session}, {"priority", 10}}, "/priority");
  refused({{"session", lifted.session}, {"output", {{"format", "obj"}}}}, "/output/format");
  refused({{"session", lifted.session}, {"preview", {{"count", 1000}}}}, "/preview");
  refused({{"session", lifted.session}, {"s", 2}}, "/s");
  json model = recipe;
  model["edits"][0]["zero"]["operations"] =
      json::array({json{{"mode", "add"},
                        {"shape",
                         {{"type", "model"},
                          {"cloud", lifted.cloud},
                          {"matrix", {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}},
                          {"thickness", 0.1}}}}});
  refused({{"recipe", model}, {"cloud", lifted.cloud}}, "/recipe/edits/0/zero/operations/0/shape/type");
  CHECK(daemon.get("/v1/jobs").json()["jobs"].empty());

  const json first = submit(daemon, {{"session", lifted.session}, {"launcher", "held"}});
  const json second = submit(daemon, {{"session", lifted.session}, {"launcher", "held"}});
  const Reply third = daemon.ask("POST", "/v1/jobs", json{{"session", lifted.session}}.dump());
  CHECK(third.status == 429);
  CHECK(third.json()["limit"] == 2);
  held.let_go();
  // What has ended goes by itself.
  CHECK(becomes([&] { return daemon.get("/v1/jobs").json()["jobs"].empty(); }, std::chrono::seconds(30)));
}

TEST_CASE("an upload that a job reads is there after a restart, and a job has it though the upload goes") {
  const TemporaryFolder folder;
  const Held held;
  const std::vector<std::string> arguments = held.arguments({"--data", folder / "data"});
  std::string upload;
  json job;
  {
    Daemon daemon(arguments);
    const Lifted lifted(daemon);
    upload = resumable(daemon, lifted.file);
    job = submit(daemon, {{"session", lifted.session}, {"upload", upload}, {"launcher", "held"}});
    daemon.stop(SIGKILL);
  }
  Daemon daemon(arguments);
  const std::string tus = "Tus-Resumable: 1.0.0\r\n";
  CHECK(daemon.ask("HEAD", "/v1/uploads/" + upload, "", tus).status == 200);
  CHECK(daemon.ask("DELETE", "/v1/uploads/" + upload, "", tus).status == 204);
  held.let_go();
  CHECK(done(daemon, job)["report"]["sample_count"] == 10000);
}

TEST_CASE("as many jobs are looked at as may run; ended ones make room for new ones") {
  const Held held;
  Daemon daemon(held.arguments({"--max-jobs", "2"}));
  const Lifted lifted(daemon);
  const json body = {{"session", lifted.session}};
  const json first = done(daemon, submit(daemon, body));
  const json second = done(daemon, submit(daemon, body));
  const json third = done(daemon, submit(daemon, body));
  CHECK(daemon.get(path_of(first)).status == 404);
  CHECK(daemon.get(path_of(second)).status == 200);
  CHECK(daemon.get("/v1/jobs").json()["jobs"].size() == 2);
  json check = body;
  check["validate"] = true;
  std::vector<int> statuses(6);
  std::vector<std::thread> askers;
  for (int& status : statuses)
    askers.emplace_back([&] { status = daemon.ask("POST", "/v1/jobs", check.dump()).status; });
  for (std::thread& asker : askers) asker.join();
  CHECK(std::count(statuses.begin(), statuses.end(), 200) >= 1);
  CHECK(std::count(statuses.begin(), statuses.end(), 200) +
            std::count(statuses.begin(), statuses.end(), 503) ==
        6);
}

TEST_CASE("launchers of Slurm start workers, and a dismissed job is cancelled there") {
  // Stand-ins for Slurm's commands: they record what they are asked for, and one node does the work here.
  const TemporaryFolder folder;
  const auto program = [&](const std::string& name, const std::string& text) {
    const std::string path = folder / name;
    std::ofstream(path) << "#!/bin/sh\necho \"" << name << " $*\" >>" << (folder / "asked") << "\n" << text;
    std::filesystem::permissions(path, std::filesystem::perms::owner_all);
  };
  program("srun", "while [ \"${1#-}\" != \"$1\" ]; do shift 2; done\n[ -e " + (folder / "wait") +
                      " ] && exec sleep 60\nexec \"$@\"\n");
  program("sbatch",
          "for a in \"$@\"; do case $a in --output=*) o=${a#*=};; esac; done\nsh worker.sh >\"$o\" 2>>log &\n"
          "echo $! >" +
              (folder / "pid") + "\necho \"7;cluster\"\n");
  program("squeue", "kill -0 $(cat " + (folder / "pid") + ") 2>/dev/null && echo 7\nexit 0\n");
  program("scancel", "pkill -P $(cat " + (folder / "pid") + "); kill $(cat " + (folder / "pid") + ")\n");
  const std::string path = "env PATH=" + (folder / "") + ":/usr/bin:/bin ";
  Daemon daemon({"--launcher", "slurm=" + path + "srun -n 2 {worker}", "--launcher",
                 "batch=" + path + POINTWRIGHT_LAUNCHERS "/slurm-batch.sh --ntasks 2 -- {worker}"});
  const Lifted lifted(daemon);
  const json plain = done(daemon, submit(daemon, {{"session", lifted.session}}));
  const std::string expected = daemon.get(path_of(plain) + "/results/result.ply").body;
  for (const char* const launcher : {"slurm", "batch"}) {
    CAPTURE(launcher);
    const json job = done(daemon, submit(daemon, {{"session", lifted.session}, {"launcher", launcher}}));
    CHECK(daemon.get(path_of(job) + "/results/result.ply").body == expected);
  }
  std::ofstream(folder / "wait") << "";
  const json held = submit(daemon, {{"session", lifted.session}, {"launcher", "batch"}});
  const auto asked = [&] {
    std::ifstream file(folder / "asked");
    return std::string(std::istreambuf_iterator<char>(file), {});
  };
  const auto count = [&](const std::string& text) {
    std::size_t times = 0;
    const std::string all = asked();
    for (std::size_t at = all.find(text); at != std::string::npos; at = all.find(text, at + 1)) ++times;
    return times;
  };
  REQUIRE(becomes([&] { return count("sbatch --parsable --ntasks 2 ") == 2 && count("srun ") == 3; }));
  CHECK(daemon.ask("DELETE", path_of(held)).status == 200);
  CHECK(becomes([&] { return count("scancel 7") == 1; }, std::chrono::seconds(5)));
  CHECK(asked().find("srun -n 2 ") != std::string::npos);
}

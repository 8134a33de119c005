// `pointwright job run` as a process that may die at any moment.
#include <doctest/doctest.h>
#include <fcntl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <random>
#include <set>
#include <span>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "engine/io/zip_archive.h"
#include "tests/acceptance/bodies.h"
#include "tests/acceptance/daemon.h"

using namespace pointwright;
using namespace pointwright::test;
using Clock = std::chrono::steady_clock;

namespace {

constexpr const char* kRecipe = R"({"format":"pointwright-recipe","version":1,"level_scales":[0.11,0.05,0],
"edits":[{"zero":{"operations":[{"mode":"add","shape":{"type":"box","min":[-1,-1,-1],"max":[0.3,2,1]}}]},
"one":{"operations":[{"mode":"add","shape":{"type":"box","min":[0.7,-1,-1],"max":[2,2,1]}}]},
"level":0,"blend":"quartic","deformation":{"type":"translation","vector":[0,0.05,0.3]}},
{"level":1,"blend":"quartic","deformation":{"type":"rotation","axis":{"point":[0.7,0.5,0.3],
"direction":[0,1,0]},"angle_deg":25}}]})";

std::string bytes_of(const std::string& path) {
  std::ostringstream bytes;
  bytes << std::ifstream(path, std::ios::binary).rdbuf();
  return bytes.str();
}

void put_sheet(const std::string& path, std::size_t side) {
  std::ofstream(path, std::ios::binary) << file_of(wavy_sheet(side));
}

/// Starts the command with its output thrown away.
pid_t start(std::vector<std::string> command) {
  std::vector<char*> arguments;
  for (std::string& argument : command) arguments.push_back(argument.data());
  arguments.push_back(nullptr);
  const pid_t child = ::fork();
  REQUIRE(child >= 0);
  if (child > 0) return child;
  const int nowhere = ::open("/dev/null", O_RDWR | O_CLOEXEC);
  ::dup2(nowhere, 1);
  ::dup2(nowhere, 2);
  ::execv(arguments[0], arguments.data());
  ::_exit(127);
}

}  // namespace

TEST_CASE("a job that is killed at any moments and started again gives the bytes of one that was not") {
  const TemporaryFolder folder;
  const std::string in = folder / "in.ply";
  const std::string out = folder / "out.ply";
  put_sheet(in, 300);
  std::ofstream(folder / "recipe.json") << kRecipe;
  const auto command = [&](const std::string& output) {
    return std::vector<std::string>{
        POINTWRIGHT_PATH, "job",  "run",      "--recipe", folder / "recipe.json", "--in", in,
        "--out",          output, "--memory", "64",       "--preview-count",      "2500", "--json"};
  };
  const auto begin = Clock::now();
  const Ended undisturbed = run(command(folder / "undisturbed.ply"));
  const auto whole = Clock::now() - begin;
  REQUIRE_MESSAGE(undisturbed.status == 0, undisturbed.err);
  CHECK(nlohmann::json::parse(undisturbed.out).at("tiles").get<int>() >= 4);
  const std::string expected = bytes_of(folder / "undisturbed.ply");

  constexpr unsigned kSeed = 20;
  constexpr int kKills = 20;
  std::mt19937 random(kSeed);
  std::uniform_real_distribution<double> part(0.0, 1.0);
  int killed = 0;
  int ended = 0;
  while (killed < kKills && ended < kKills) {
    const pid_t child = start(command(out));
    std::this_thread::sleep_for(part(random) * whole);
    ::kill(child, SIGKILL);
    int status = 0;
    REQUIRE(::waitpid(child, &status, 0) == child);
    if (WIFSIGNALED(status)) {
      ++killed;
      // The result has its name once it is whole.
      if (std::filesystem::exists(out)) CHECK(bytes_of(out) == expected);
      continue;
    }
    REQUIRE(WEXITSTATUS(status) == 0);
    CHECK(bytes_of(out) == expected);
    std::filesystem::remove(out);  // and from the beginning
    ++ended;
  }
  const Ended last = run(command(out));
  REQUIRE_MESSAGE(last.status == 0, last.err);
  CHECK(bytes_of(out) == expected);
  for (const auto& entry : std::filesystem::directory_iterator(folder / ""))
    CHECK(entry.path().filename().string().find(".new-") == std::string::npos);
  CHECK_FALSE(std::filesystem::exists(out + ".job"));
}

TEST_CASE(
    "packed scans come in and out by the command line, decoded in confined processes where that is asked "
    "for") {
  const TemporaryFolder folder;
  const std::string in = folder / "in.zip";
  std::ofstream(in, std::ios::binary) << file_of(wavy_sheet(200), CloudFormat::kDracoTiles);
  std::ofstream(folder / "recipe.json") << kRecipe;
  const auto command = [&](const std::string& output, const std::vector<std::string>& more) {
    std::vector<std::string> words{
        POINTWRIGHT_PATH, "job",  "run",      "--recipe", folder / "recipe.json", "--in", in,
        "--out",          output, "--memory", "64",       "--preview-count",      "2500", "--json"};
    words.insert(words.end(), more.begin(), more.end());
    return words;
  };
  const Ended plain = run(command(folder / "plain.zip", {}));
  REQUIRE_MESSAGE(plain.status == 0, plain.err);
  const auto report = nlohmann::json::parse(plain.out);
  CHECK(report["mode"] == "tiles");
  CHECK(report["moved"].get<int>() > 10'000);
  const Ended confined = run(command(folder / "confined.zip", {"--confined", "--most-memory", "2048"}));
  REQUIRE_MESSAGE(confined.status == 0, confined.err);
  const std::string expected = bytes_of(folder / "plain.zip");
  CHECK(bytes_of(folder / "confined.zip") == expected);
#ifdef POINTWRIGHT_MPIEXEC
  for (const std::string ranks : {"2", "4"}) {
    CAPTURE(ranks);
    const std::string out = folder / ("by" + ranks + ".zip");
    std::vector<std::string> several = command(out, {"--threads", "1"});
    const std::vector<std::string> launcher{POINTWRIGHT_MPIEXEC, "--allow-run-as-root", "--oversubscribe",
                                            "-n", ranks};
    several.insert(several.begin(), launcher.begin(), launcher.end());
    const Ended ended = run(several);
    REQUIRE_MESSAGE(ended.status == 0, ended.err);
    CHECK(bytes_of(out) == expected);
    CHECK_FALSE(std::filesystem::exists(out + ".job"));
  }
#endif
  // A tile that cannot be decoded is told by its name.
  const std::string whole = bytes_of(in);
  auto reader = ZipReader::open(std::as_bytes(std::span(whole)));
  REQUIRE(reader.ok());
  std::vector<std::pair<std::string, std::vector<std::byte>>> files;
  while (const auto name = reader.value().next().value())
    files.emplace_back(*name, reader.value().content(std::uint64_t{1} << 30U).value());
  std::vector<ZipEntry> entries;
  for (auto& file : files) {
    if (file.first != "index.csv") file.second[5] = std::byte{9};  // the version of Draco
    entries.push_back({.name = file.first, .bytes = file.second.size(), .content = [&file] {
                         return Result(file.second);
                       }});
  }
  std::ofstream torn(in, std::ios::binary);
  REQUIRE(write_zip(entries, [&](std::span<const std::byte> bytes) {
            torn.write(reinterpret_cast<const char*>(bytes.data()),
                       static_cast<std::streamsize>(bytes.size()));
            return true;
          }).ok());
  torn.close();
  const Ended refused = run(command(folder / "none.zip", {"--confined"}));
  CHECK(refused.status != 0);
  CHECK(refused.err.find("'tiles/000000.drc': ") != std::string::npos);
  CHECK(refused.err.find("ZIP") == std::string::npos);
  CHECK_FALSE(std::filesystem::exists(folder / "none.zip.job"));
  CHECK_FALSE(std::filesystem::exists(folder / "none.zip"));
}

TEST_CASE(
    "a packed job that is killed at any moments gives the bytes of one that was not, and leaves nothing") {
  const TemporaryFolder folder;
  const std::string in = folder / "in.zip";
  const std::string out = folder / "out.zip";
  std::ofstream(in, std::ios::binary) << file_of(wavy_sheet(300), CloudFormat::kDracoTiles);
  std::ofstream(folder / "recipe.json") << kRecipe;
  const auto command = [&](const std::string& output) {
    return std::vector<std::string>{
        POINTWRIGHT_PATH, "job",  "run",      "--recipe", folder / "recipe.json", "--in", in,
        "--out",          output, "--memory", "64",       "--preview-count",      "2500", "--json"};
  };
  const auto begin = Clock::now();
  REQUIRE(run(command(folder / "undisturbed.zip")).status == 0);
  const auto whole = Clock::now() - begin;
  const std::string expected = bytes_of(folder / "undisturbed.zip");
  constexpr unsigned kSeed = 7;
  std::mt19937 random(kSeed);
  std::uniform_real_distribution<double> part(0.3, 1.0);
  for (int killed = 0, tried = 0; killed < 8 && tried < 40; ++tried) {
    const pid_t child = start(command(out));
    std::this_thread::sleep_for(part(random) * whole);
    ::kill(child, SIGKILL);
    int status = 0;
    REQUIRE(::waitpid(child, &status, 0) == child);
    killed += WIFSIGNALED(status) ? 1 : 0;
    if (std::filesystem::exists(out)) CHECK(bytes_of(out) == expected);
    std::filesystem::remove(out);
  }
  REQUIRE(run(command(out)).status == 0);
  CHECK(bytes_of(out) == expected);
  std::set<std::string> left;
  for (const auto& entry : std::filesystem::directory_iterator(folder / ""))
    left.insert(entry.path().filename().string());
  CHECK(left == std::set<std::string>{"in.zip", "out.zip", "recipe.json", "undisturbed.zip"});
}

#ifdef POINTWRIGHT_MPIEXEC
TEST_CASE("one process or several under mpirun give the same bytes, and go on with each other's work") {
  const TemporaryFolder folder;
  const std::string in = folder / "in.ply";
  put_sheet(in, 300);
  std::ofstream(folder / "recipe.json") << kRecipe;
  const auto command = [&](int ranks, const std::string& output, std::vector<std::string> more = {}) {
    std::vector<std::string> words;
    if (ranks > 0)
      words = {POINTWRIGHT_MPIEXEC, "--allow-run-as-root", "--oversubscribe", "-n", std::to_string(ranks)};
    words.insert(words.end(), {POINTWRIGHT_PATH, "job", "run", "--recipe", folder / "recipe.json", "--in", in,
                               "--out", output, "--memory", "64", "--preview-count", "2500", "--json"});
    words.insert(words.end(), more.begin(), more.end());
    return words;
  };
  const Ended alone = run(command(0, folder / "alone.ply"));
  REQUIRE_MESSAGE(alone.status == 0, alone.err);
  const std::string expected = bytes_of(folder / "alone.ply");
  const auto told = nlohmann::json::parse(alone.out);
  for (const int ranks : {1, 2, 4}) {
    CAPTURE(ranks);
    const std::string out = folder / ("by" + std::to_string(ranks) + ".ply");
    const Ended ended = run(command(ranks, out, {"--threads", "1"}));
    REQUIRE_MESSAGE(ended.status == 0, ended.err);
    CHECK(bytes_of(out) == expected);
    CHECK_FALSE(std::filesystem::exists(out + ".job"));
    const auto report = nlohmann::json::parse(ended.out);  // one report, whoever worked
    CHECK(report["moved"] == told["moved"]);
    CHECK(report["preview"] == told["preview"]);
  }
  const Ended in_memory = run(command(2, folder / "memory.ply", {"--mode", "memory"}));
  REQUIRE_MESSAGE(in_memory.status == 0, in_memory.err);
  CHECK(bytes_of(folder / "memory.ply") == expected);

  // Two begin, one ends it.
  const std::string out = folder / "cut.ply";
  const pid_t two = start(command(2, out));
  for (int i = 0; i < 3000 && !std::filesystem::exists(out + ".job/job.id"); ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  std::this_thread::sleep_for(std::chrono::milliseconds(30));
  ::kill(two, SIGTERM);  // which mpirun hands on
  int status = 0;
  REQUIRE(::waitpid(two, &status, 0) == two);
  const Ended rest = run(command(0, out));
  REQUIRE_MESSAGE(rest.status == 0, rest.err);
  CHECK(bytes_of(out) == expected);

  // What is wrong is said once, and nobody waits for the others.
  std::ofstream(folder / "torn.ply") << bytes_of(in).substr(0, 4000);
  auto torn = command(2, folder / "none.ply");
  for (std::string& word : torn)
    if (word == in) word = folder / "torn.ply";
  const Ended refused = run(torn);
  CHECK(refused.status != 0);
  CHECK(refused.err.find("pointwright: ") != std::string::npos);
  CHECK_FALSE(std::filesystem::exists(folder / "none.ply"));
}
#endif

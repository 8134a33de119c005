// Jobs in tiles on scans that are no records, and results that become Draco tiles.
#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <numeric>
#include <string>
#include <vector>

#include "engine/core/parallel.h"
#include "engine/io/draco_tiles.h"
#include "server/jobs/packed_result.h"
#include "server/jobs/team.h"
#include "tests/server/job_folder.h"

using namespace pointwright;
using namespace pointwright::server;
using namespace pointwright::test;
using protocol::ProblemKind;

namespace {

/// ASCII, of doubles and integers in an odd order, with a list, blank lines and faces.
std::string text_ply(std::size_t side, const std::string& line_end) {
  std::string text = "ply\nformat ascii 1.0\nelement vertex " + std::to_string(side * side) +
                     "\nproperty ushort flag\nproperty double z\nproperty list uchar int near\n"
                     "property double x\nproperty float y\nelement face 2\n"
                     "property list uchar int vertex_indices\nend_header\n";
  for (std::size_t i = 0; i < side * side; ++i) {
    const double x = static_cast<double>(i % side) / static_cast<double>(side - 1);
    const double y = static_cast<double>(i / side) / static_cast<double>(side - 1);
    text += std::to_string(i % 50'000) + "  " + std::to_string(0.01 * std::sin(9.0 * x)) + " 2 7 8 " +
            std::to_string(x) + "\t" + std::to_string(y) + " \n";
    if (i % 1000 == 999) text += "  \n\n";
  }
  text += "3 0 1 2\n3 1 2 3\n";
  if (line_end == "\n") return text;
  std::string other;
  for (const char c : text) c == '\n' ? other += line_end : other += c;
  return other;
}

/// The same samples in binary.
std::string unpacked(const std::string& path) {
  const Cloud cloud = cloud_of(path);
  const auto bytes = write_cloud(cloud, CloudFormat::kPly, {});
  REQUIRE(bytes.ok());
  return {reinterpret_cast<const char*>(bytes.value().data()), bytes.value().size()};
}

/// Positions and colours of both, whatever the order.
void same_samples(const Cloud& a, const Cloud& b) {
  REQUIRE(a.size() == b.size());
  const auto sorted = [](const Cloud& cloud) {
    std::vector<std::array<double, 4>> all;
    for (std::size_t i = 0; i < cloud.size(); ++i) {
      const Vec3d p = model_position(cloud, i);
      all.push_back({p.x(), p.y(), p.z(), cloud.has_colors() ? static_cast<double>(cloud.color[i][0]) : 0.0});
    }
    std::ranges::sort(all);
    return all;
  };
  CHECK(sorted(a) == sorted(b));
}

}  // namespace

TEST_CASE("an ASCII scan is edited in tiles as its binary twin is, whatever ends its lines") {
  const JobFolder job;
  std::string expected;
  for (const std::string line_end : {"\n", "\r\n", "\r"}) {
    CAPTURE(line_end.size());
    put(job.in, text_ply(120, line_end));
    const JobReport report = job.run(job.params());
    CHECK(report.mode == JobMode::kTiles);
    CHECK(report.samples == 14'400);
    CHECK(report.tiles > 2);
    CHECK(report.moved > 5000);
    if (expected.empty()) {
      expected = bytes_of(job.out);
      put(job.in, unpacked(job.in));
      CHECK(job.run(job.params()).moved == report.moved);
      const Cloud twin = cloud_of(job.out);
      put(job.out, expected);
      const Cloud made = cloud_of(job.out);
      CHECK(made.exact_position == twin.exact_position);
      CHECK(made.position == twin.position);
      REQUIRE(made.scalars.size() == 1);
      CHECK(made.scalars == twin.scalars);
    }
    CHECK(bytes_of(job.out) == expected);
  }
}

TEST_CASE("a recipe without effect gives packed scans back, byte by byte") {
  const JobFolder job;
  JobParams params = job.params();
  params.request.s = 0.0;
  put(job.in, text_ply(60, "\r\n"));
  CHECK(job.run(params).moved == 0);
  CHECK(bytes_of(job.out) == bytes_of(job.in));
  params.input = job.folder / "in.zip";
  params.output = job.folder / "out.zip";
  put(params.input, wavy_sheet(60), CloudFormat::kDracoTiles);
  const JobReport report = job.run(params);
  CHECK(report.mode == JobMode::kTiles);
  CHECK(bytes_of(params.output) == bytes_of(params.input));
  // As another format its samples are the same.
  params.output = job.out;
  job.run(params);
  same_samples(cloud_of(job.out), wavy_sheet(60));
}

TEST_CASE("text that breaks off, goes on or holds a word is refused with its line") {
  const JobFolder job;
  const std::string whole = text_ply(300, "\n");
  const auto refused_with = [&](const std::string& text) {
    put(job.in, text);
    JobParams params = job.params();
    params.mode = JobMode::kTiles;
    const std::string detail = job.refused(params).detail;
    CHECK_FALSE(std::filesystem::exists(params.folder));
    return detail;
  };
  CHECK(refused_with(whole.substr(0, whole.size() - 20)).find("before all 2 rows") != std::string::npos);
  CHECK(refused_with(whole.substr(0, whole.size() / 2)).find("before all 90000 rows") != std::string::npos);
  CHECK(refused_with(whole + "3 1 2 3\n").find("1 more rows") != std::string::npos);
  // Of the 70,000th sample and of the 20,000th: two blank lines stand behind each thousand.
  const std::size_t body = whole.find("end_header\n") + 11;
  const auto header_lines =
      std::count(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(body), '\n');
  const auto line_of = [](std::size_t sample) { return sample + 2 * (sample / 1000); };
  const auto begin_of = [&](const std::string& text, std::size_t sample) {
    std::size_t at = body;
    for (std::size_t line = 0; line < line_of(sample); ++line) at = text.find('\n', at) + 1;
    return at;
  };
  const auto named = [&](std::size_t sample) {
    return "line " + std::to_string(static_cast<std::size_t>(header_lines) + line_of(sample) + 1) + ":";
  };
  std::string wrong = whole;
  wrong.replace(begin_of(wrong, 70'000), 1, "x");
  CHECK(refused_with(wrong).find(named(70'000)) != std::string::npos);
  // The first one is told, whichever thread meets it; and a row that is too short by its property.
  const std::size_t early = begin_of(wrong, 20'000);
  wrong.erase(wrong.find('\t', early), wrong.find('\n', early) - wrong.find('\t', early));
  const std::string told = refused_with(wrong);
  CHECK(told.find(named(20'000)) != std::string::npos);
  CHECK(told.find("before property 'y'") != std::string::npos);
  // Where most rows are, as well.
  std::string bare = whole.substr(0, begin_of(whole, 30'000));
  for (std::size_t row = 30'000; row < 90'000; ++row) bare += "7\n";
  bare += "3 0 1 2\n3 1 2 3\n";
  CHECK(refused_with(bare).find(named(30'000)) != std::string::npos);
  CHECK_FALSE(std::filesystem::exists(job.out));
}

TEST_CASE("Draco tiles go in and out of tiles: with every attribute, any number of threads, in steps") {
  const JobFolder job;
  Cloud sheet = wavy_sheet(200);
  std::vector<std::uint16_t> numbers(sheet.size());
  for (std::size_t i = 0; i < numbers.size(); ++i) numbers[i] = static_cast<std::uint16_t>(i * 7);
  sheet.scalars.push_back({.name = "intensity", .values = numbers});
  put(job.in, sheet);
  JobParams params = job.params();
  const JobReport plain = job.run(params);
  const Cloud expected = cloud_of(job.out);

  params.output = job.folder / "out.zip";
  std::string first;
  for (const int threads : {1, 2, 8}) {
    with_threads(threads, [&] {
      const JobReport report = job.run(params);
      CHECK(report.mode == JobMode::kTiles);
      CHECK(report.moved == plain.moved);
      CHECK(report.files == std::vector<std::string>{params.output});
    });
    if (first.empty()) first = bytes_of(params.output);
    CHECK(bytes_of(params.output) == first);
  }
  const Cloud packed = cloud_of(params.output);
  same_samples(packed, expected);
  CHECK(packed.scalars.at(0).name == "intensity");
  const auto bytes = read_file(params.output);
  REQUIRE(bytes.ok());
  const auto reader = DracoTilesReader::open(bytes.value(), sheet.size());
  REQUIRE(reader.ok());
  CHECK(reader.value().tiles().size() > 4);

  // What it wrote is read again, tile by tile.
  params.input = params.output;
  params.request.s = 0.5;
  params.steps = 3;
  params.output = job.folder / "again.zip";
  const JobReport report = job.run(params);
  REQUIRE(report.files.size() == 3);
  CHECK(report.files[2] == job.folder / "again_0003.zip");
  CHECK(bytes_of(report.files[0]) == bytes_of(params.input));
  same_samples(cloud_of(report.files[0]), packed);
  const Cloud half = cloud_of(report.files[1]);
  CHECK(half.size() == packed.size());
  CHECK(half.scalars.at(0).name == "intensity");
  CHECK(bytes_of(report.files[1]) != bytes_of(report.files[2]));
}

TEST_CASE("tiles are written no larger than they may be, wherever the samples stand") {
  const JobFolder job;
  Cloud heap = wavy_sheet(100);
  std::vector<std::uint32_t> order(heap.size());
  std::iota(order.begin(), order.end(), 0U);
  order.insert(order.end(), kMostTileSamples + 5, 7U);
  heap = permuted(heap, order);
  std::iota(heap.id.begin(), heap.id.end(), 0U);
  put(job.in, heap);
  const auto team = lone_team();
  const auto problem =
      pack_result(job.in, job.folder / "out.zip", job.folder / "scratch", std::uint64_t{1} << 26U, *team,
                  ExecutionContext(), [](const std::string&, double) {});
  REQUIRE_FALSE(problem.has_value());
  CHECK_FALSE(std::filesystem::exists(job.folder / "scratch"));
  const auto bytes = read_file(job.folder / "out.zip");
  REQUIRE(bytes.ok());
  const auto reader = DracoTilesReader::open(bytes.value(), heap.size());
  REQUIRE(reader.ok());
  CHECK(reader.value().sample_count() == heap.size());
  for (const DracoTile& tile : reader.value().tiles()) CHECK(tile.sample_count <= kMostTileSamples);
  same_samples(cloud_of(job.folder / "out.zip"), heap);
}

TEST_CASE("samples that are inserted come out in Draco tiles, too") {
  const JobFolder job;
  put(job.in, wavy_sheet(100));
  JobParams params = job.params(1);
  params.request.recipe.edits[0].edit.deformation.steps = {Translation{.vector = {1.0, 0.0, 0.0}}};
  params.request.recipe.edits[0].edit.resampling = ResamplingParams{};
  params.memory_bytes = std::uint64_t{1} << 27U;
  const JobReport plain = job.run(params);
  CHECK(plain.inserted > 2000);
  params.output = job.folder / "out.zip";
  CHECK(job.run(params).inserted == plain.inserted);
  same_samples(cloud_of(params.output), cloud_of(job.out));
}

TEST_CASE("a packed job that was interrupted keeps its tiles, whenever it ended") {
  const JobFolder job;
  JobParams params = job.params();
  params.input = job.folder / "in.zip";
  params.output = job.folder / "out.zip";
  put(params.input, wavy_sheet(200), CloudFormat::kDracoTiles);
  job.run(params);
  const std::string undisturbed = bytes_of(params.output);
  std::filesystem::remove(params.output);
  for (const char* last_phase : {"unpacking", "tile 4 of", "result", "packing"}) {
    CAPTURE(last_phase);
    const ExecutionContext context;
    REQUIRE_FALSE(run_full_resolution(params, context, [&](const std::string& phase, double) {
                    if (phase.starts_with(last_phase)) context.cancel();
                  }).ok());
    CHECK_FALSE(std::filesystem::exists(params.output));
  }
  CHECK(std::filesystem::exists(params.folder));
  const JobReport report = job.run(params);
  CHECK(report.tiles_kept == report.tiles);
  CHECK(bytes_of(params.output) == undisturbed);

  // As a killed one leaves its folder: with results half packed, which the next one has no use for.
  const ExecutionContext context;
  REQUIRE_FALSE(run_full_resolution(params, context, [&](const std::string& phase, double) {
                  if (phase == "result") context.cancel();
                }).ok());
  std::filesystem::create_directories(params.folder + "/tiles.packed");
  for (const char* const name : {"tiles.packed/records.bin", "tiles.packed/tile-0-0.packed",
                                 "edited.unpacked", "edited.unpacked.new-1-0", "tile-0-0.result.new-1-0"})
    put(params.folder + "/" + name, "torn");
  params.output = job.out;
  CHECK(job.run(params).tiles_kept == report.tiles);  // which sees that nothing is left
}

TEST_CASE(
    "what tiles cannot do is told, or done in memory, and a dry run knows how much a packed scan takes") {
  const JobFolder job;
  put(job.in, text_ply(60, "\n"));
  JobParams params = job.params();
  params.output = job.folder / "out.las";
  params.mode = JobMode::kTiles;
  CHECK(job.refused(params).kind == ProblemKind::kUnsupportedFormat);
  params.mode = std::nullopt;
  CHECK(job.run(params).mode == JobMode::kMemory);
  params.output = job.folder / "out.zip";
  const auto estimate = estimate_full_resolution(params, ExecutionContext());
  REQUIRE(estimate.ok());
  CHECK(estimate.value().mode == JobMode::kTiles);
  CHECK(estimate.value().samples == 3600);
  CHECK(estimate.value().disk_bytes > 3600 * (3 * 32 + 3 * 22));
  // What leaves out samples is no work for tiles.
  params.output = job.out;
  std::string holed = text_ply(60, "\n");
  const std::size_t at = holed.find("end_header\n") + 11;
  holed.replace(at, holed.find('\n', at) - at, "0 nan 2 7 8 0.5 0.5");
  put(job.in, holed);
  params.drop_non_finite = true;
  const JobReport dropped = job.run(params);
  CHECK(dropped.mode == JobMode::kMemory);
  CHECK(dropped.samples == 3599);
  std::filesystem::remove(job.out);
  params.drop_non_finite = false;
  params.mode = JobMode::kTiles;
  CHECK(job.refused(params).kind == ProblemKind::kNonFinite);
  CHECK_FALSE(std::filesystem::exists(params.folder));
  put(job.in, text_ply(60, "\n"));
  params.output = job.folder / "out.zip";
  // In memory the format serves as any other.
  params.mode = JobMode::kMemory;
  CHECK(job.run(params).mode == JobMode::kMemory);
  CHECK(cloud_of(params.output).size() == 3600);
}

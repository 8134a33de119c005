// Jobs: a recipe on scan files, in tiles and otherwise.
#include <doctest/doctest.h>
#include <fcntl.h>
#include <sys/file.h>

#include <array>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <set>

#include "engine/core/parallel.h"
#include "engine/io/cloud_io.h"
#include "protocol/json/jobs.h"
#include "protocol/json/parse.h"
#include "server/base/descriptor.h"
#include "server/ingest/files.h"
#include "tests/server/job_folder.h"
#include "tests/server/synthetic.h"

using namespace pointwright;
using namespace pointwright::server;
using namespace pointwright::test;
using protocol::ProblemKind;

namespace {

/// Big-endian, doubles, properties in an odd order and of other types, normals, a face and bytes after it.
std::string odd_ply(std::size_t side) {
  std::string text =
      "ply\nformat binary_big_endian 1.0\ncomment kept\nelement vertex " + std::to_string(side * side) +
      "\nproperty uchar flag\nproperty double z\nproperty float nx\nproperty float ny\nproperty float nz\n"
      "property double x\nproperty double y\nproperty short tail\nelement face 1\n"
      "property list uchar int vertex_indices\nend_header\n";
  const auto append = [&](auto value) {
    std::string raw(sizeof value, '\0');
    std::memcpy(raw.data(), &value, sizeof value);
    text.append(raw.rbegin(), raw.rend());
  };
  for (std::size_t i = 0; i < side * side; ++i) {
    const double x = static_cast<double>(i % side) / static_cast<double>(side - 1);
    const double y = static_cast<double>(i / side) / static_cast<double>(side - 1);
    append(static_cast<std::uint8_t>(i));
    append(0.01 * std::sin(9.0 * x) + 1e-12 * y);
    append(0.0F);
    append(0.0F);
    append(2.0F);  // not of unit length
    append(x + 1e-13);
    append(y);
    append(static_cast<std::int16_t>(i * 7));
  }
  append(std::uint8_t{3});
  for (const std::int32_t corner : {0, 1, 2}) append(corner);
  return text;
}

}  // namespace

TEST_CASE("a recipe without effect gives a job's input back, byte by byte, whatever the records hold") {
  const JobFolder job;
  put(job.in, odd_ply(60));
  for (const std::size_t edits : {0, 2}) {
    JobParams params = job.params(edits);
    params.request.s = 0.0;
    const JobReport report = job.run(params);
    CHECK(report.mode == JobMode::kTiles);
    CHECK(report.samples == 3600);
    CHECK(report.moved == 0);
    CHECK(report.matched > 2000);
    CHECK(report.max_difference == 0.0);
    CHECK(bytes_of(job.out) == bytes_of(job.in));
  }
}

TEST_CASE("a job changes positions and normals of what moves, and not a byte of anything else") {
  const JobFolder job;
  constexpr std::size_t kSide = 120;
  put(job.in, odd_ply(kSide));
  const JobReport report = job.run(job.params());
  CHECK(report.tiles > 2);
  const std::string before = bytes_of(job.in);
  const std::string after = bytes_of(job.out);
  REQUIRE(before.size() == after.size());
  const std::size_t head = before.find("end_header\n") + 11;
  constexpr std::size_t kRecord = 1 + 8 + 12 + 16 + 2;
  CHECK(before.substr(0, head) == after.substr(0, head));
  CHECK(before.substr(head + kSide * kSide * kRecord) == after.substr(head + kSide * kSide * kRecord));
  std::size_t moved = 0;
  for (std::size_t i = 0; i < kSide * kSide; ++i) {
    const std::string a = before.substr(head + i * kRecord, kRecord);
    const std::string b = after.substr(head + i * kRecord, kRecord);
    CHECK(a[0] == b[0]);
    CHECK(a.substr(kRecord - 2) == b.substr(kRecord - 2));
    const double x = static_cast<double>(i % kSide) / static_cast<double>(kSide - 1);
    if (x < 0.25) CHECK(a == b);
    if (x > 0.75) CHECK(a.substr(1, 8) != b.substr(1, 8));
    if (a != b) ++moved;
  }
  CHECK(moved == report.moved);
  // The rotation of the right side turns its normals by 25 degrees about y.
  const Cloud made = cloud_of(job.out);
  CHECK(std::acos(made.normal[kSide * kSide - 1].z()) ==
        doctest::Approx(protocol::to_radians(25.0)).epsilon(0.2));
}

TEST_CASE("a preview that is given is the one that counts, in tiles and in memory, whatever its origin") {
  const JobFolder job;
  const Cloud sheet = wavy_sheet(200);
  put(job.in, sheet);
  std::vector<std::uint32_t> every;
  for (std::uint32_t i = 0; i < sheet.size(); i += 8) every.push_back(i);
  auto preview = std::make_shared<Cloud>(permuted(sheet, every));
  JobParams params = job.params();
  params.preview = preview;
  const JobReport tiled = job.run(params);
  CHECK(tiled.preview_samples == every.size());
  CHECK(tiled.matched == every.size());
  const Cloud expected = cloud_of(job.out);
  params.mode = JobMode::kMemory;
  CHECK(job.run(params).matched == every.size());
  CHECK(cloud_of(job.out).position == expected.position);
  // Of another scan altogether.
  for (const JobMode mode : {JobMode::kTiles, JobMode::kMemory}) {
    JobParams other = params;
    auto elsewhere = std::make_shared<Cloud>(*preview);
    elsewhere->origin = Vec3d(0.0, 2.0, 0.0);
    other.preview = elsewhere;
    other.mode = mode;
    other.output = job.folder / "none.ply";
    CHECK(job.refused(other).kind == ProblemKind::kInvalidValue);
  }
  // About another origin, which float32 rounds a little differently.
  preview->origin = Vec3d(4.0, 0.0, 0.0);
  for (std::size_t i = 0; i < preview->size(); ++i)
    preview->position.set(i, preview->position[i] - Vec3f(4.0F, 0.0F, 0.0F));
  for (const JobMode mode : {JobMode::kTiles, JobMode::kMemory}) {
    params.mode = mode;
    const JobReport moved = job.run(params);
    CHECK(moved.matched == every.size());
    double worst = 0.0;
    const Cloud made = cloud_of(job.out);
    for (std::size_t i = 0; i < made.size(); ++i)
      worst = std::max(worst, static_cast<double>((made.position[i] - expected.position[i]).norm()));
    CHECK(worst < 1e-4);
  }
}

TEST_CASE("a flat scan in doubles has the preview that is made of it, or one whose file has rounded it") {
  const JobFolder job;
  Cloud sheet = wavy_sheet(60);
  sheet.position_is_double = true;
  sheet.exact_position.resize(sheet.size());
  for (std::size_t i = 0; i < sheet.size(); ++i) {
    const Vec3f p = sheet.position[i];
    sheet.position.set(i, {p.x(), p.y(), 0.1F});
    sheet.exact_position[i] = {static_cast<double>(p.x()), static_cast<double>(p.y()), 0.1};
  }
  put(job.in, sheet);
  Cloud rounded = sheet;
  rounded.position_is_double = false;
  rounded.exact_position.clear();
  JobParams params = job.params(1);
  for (const JobMode mode : {JobMode::kTiles, JobMode::kMemory})
    for (const bool is_given : {false, true}) {
      params.mode = mode;
      params.preview = is_given ? std::make_shared<const Cloud>(rounded) : nullptr;
      CHECK(job.run(params).moved > 1000);
    }
}

TEST_CASE("in tiles and in memory the same comes out, with any number of threads") {
  const JobFolder job;
  put(job.in, wavy_sheet(200));
  JobParams params = job.params();
  params.mode = JobMode::kMemory;
  const JobReport whole = job.run(params);
  const Cloud expected = cloud_of(job.out);
  CHECK(whole.rms_difference < 0.1 * whole.spacing);
  params.mode = JobMode::kTiles;
  std::string first;
  for (const int threads : {1, 2, 8}) {
    with_threads(threads, [&] {
      const JobReport report = job.run(params);
      CHECK(report.tiles >= 8);
      CHECK(report.moved == whole.moved);
    });
    if (first.empty()) first = bytes_of(job.out);
    CHECK(bytes_of(job.out) == first);
  }
  const Cloud tiled = cloud_of(job.out);
  // The preview is another choice of samples where the file's order, not the coherent one, is surveyed.
  double worst = 0.0;
  for (std::size_t i = 0; i < expected.size(); ++i)
    worst = std::max(worst, static_cast<double>((tiled.position[i] - expected.position[i]).norm()));
  CHECK(worst < 0.5 * whole.spacing);
  CHECK(tiled.color == expected.color);
}

TEST_CASE("tiles leave no seam: many small ones and a single large one agree to the bit") {
  const JobFolder job;
  put(job.in, wavy_sheet(200));
  JobParams params = job.params();
  CHECK(job.run(params).tiles >= 8);
  const std::string many = bytes_of(job.out);
  params.memory_bytes = std::uint64_t{1} << 30U;
  CHECK(job.run(params).tiles == 1);
  CHECK(bytes_of(job.out) == many);
}

TEST_CASE("strays far from everything leave the tiles of the others as they are") {
  const JobFolder job;
  Cloud sheet = wavy_sheet(200);
  // One in a thousand stands somewhere in a space that is fifty times the sheet.
  for (std::size_t i = 0; i < sheet.size(); i += 1000)
    sheet.position.set(
        i, Vec3f(std::fmod(static_cast<float>(i) * 0.37F, 50.0F), 3.0F, 0.001F * static_cast<float>(i)));
  put(job.in, permuted(sheet, coherent_order(sheet.position)));
  JobParams params = job.params();
  params.request.recipe.level_scales = {0.11, 0.05, 0.0};
  CHECK(job.run(params).tiles >= 8);
  const Cloud many = cloud_of(job.out);
  params.memory_bytes = std::uint64_t{1} << 30U;
  CHECK(job.run(params).tiles == 1);
  const Cloud one = cloud_of(job.out);
  std::size_t same = 0;
  for (std::size_t i = 0; i < one.size(); ++i)
    if (many.position[i] == one.position[i]) ++same;
  CHECK(static_cast<double>(same) > 0.999 * static_cast<double>(one.size()));
}

TEST_CASE("a job that was interrupted goes on from its tiles, and gives the bytes of one that was not") {
  const JobFolder job;
  put(job.in, wavy_sheet(200));
  const JobParams params = job.params();
  job.run(params);
  const std::string undisturbed = bytes_of(job.out);
  std::filesystem::remove(job.out);
  for (const char* last_phase : {"tiles", "tile 4 of", "result"}) {
    CAPTURE(last_phase);
    const ExecutionContext context;
    const auto report = run_full_resolution(params, context, [&](const std::string& phase, double) {
      if (phase.starts_with(last_phase)) context.cancel();
    });
    REQUIRE_FALSE(report.ok());
    CHECK_FALSE(std::filesystem::exists(job.out));
  }
  const JobReport report = job.run(params);
  CHECK(report.tiles_kept == report.tiles);
  CHECK(bytes_of(job.out) == undisturbed);
}

TEST_CASE("tiles of another recipe or another input are not taken for this job's") {
  const JobFolder job;
  put(job.in, wavy_sheet(150));
  const JobParams params = job.params();
  const ExecutionContext context;
  REQUIRE_FALSE(run_full_resolution(params, context, [&](const std::string& phase, double) {
                  if (phase == "result") context.cancel();
                }).ok());
  JobParams other = params;
  other.request = lifting(1);
  CHECK(job.run(other).tiles_kept == 0);

  // A single sample that is another one makes it another input.
  const auto interrupt = [&] {
    const ExecutionContext context2;
    REQUIRE_FALSE(run_full_resolution(params, context2, [&](const std::string& phase, double) {
                    if (phase == "result") context2.cancel();
                  }).ok());
  };
  interrupt();
  Cloud changed = wavy_sheet(150);
  changed.position.set(150 * 75 + 70, changed.position[150 * 75 + 70] + Vec3f(0.0F, 0.0F, 1e-4F));
  put(job.in, changed);
  CHECK(job.run(params).tiles_kept == 0);
  const std::string expected = bytes_of(job.out);
  // Theirs, ours half sorted, and theirs again.
  interrupt();
  put(job.in, wavy_sheet(150));
  const ExecutionContext sorting;
  REQUIRE_FALSE(run_full_resolution(params, sorting, [&](const std::string& phase, double) {
                  if (phase == "tiles") sorting.cancel();
                }).ok());
  put(job.in, changed);
  job.run(params);
  CHECK(bytes_of(job.out) == expected);
}

TEST_CASE("a job has its folder to itself, and leaves in it what is not its own") {
  const JobFolder job;
  put(job.in, wavy_sheet(100));
  JobParams params = job.params();
  std::filesystem::create_directory(params.folder);
  put(params.folder + "/mine.result", "mine");
  put(params.folder + "/tile-notes.txt", "mine");
  {
    const Descriptor other(::open(params.folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
    REQUIRE(::flock(other.get(), LOCK_EX | LOCK_NB) == 0);
    CHECK(job.refused(params).kind == ProblemKind::kWrongState);
  }
  params.input = params.folder + "/in.ply";
  params.output = params.folder + "/out.ply";
  put(params.input, wavy_sheet(100));
  const auto report = run_full_resolution(params, ExecutionContext(), [](const std::string&, double) {});
  REQUIRE(report.ok());
  std::set<std::string> left;
  for (const auto& entry : std::filesystem::directory_iterator(params.folder))
    left.insert(entry.path().filename().string());
  CHECK(left == std::set<std::string>{"in.ply", "mine.result", "out.ply", "tile-notes.txt"});
  params.output = params.folder;
  CHECK_FALSE(run_full_resolution(params, ExecutionContext(), [](const std::string&, double) {}).ok());
  params.output = job.folder / "none/out.ply";
  CHECK(job.refused(params).kind == ProblemKind::kInvalidValue);
}

TEST_CASE("an animation's clouds are those of plain jobs, the first one the input to the bit") {
  const JobFolder job;
  put(job.in, odd_ply(120));
  JobParams params = job.params();
  for (const protocol::Timing timing : {protocol::Timing::kSequence, protocol::Timing::kTogether}) {
    params.request.timing = timing;
    params.steps = 5;
    params.output = job.out;
    const JobReport report = job.run(params);
    CHECK(report.tiles > 2);
    CHECK(report.moved > 5000);
    REQUIRE(report.files.size() == 5);
    CHECK(report.files == outputs_of(params));
    CHECK(report.files[1] == job.folder / "out_0002.ply");
    CHECK_FALSE(std::filesystem::exists(job.out));
    CHECK(bytes_of(report.files[0]) == bytes_of(job.in));
    params.steps = std::nullopt;
    for (std::size_t k = 1; k < 5; ++k) {
      params.request.s = static_cast<double>(k) / 4.0;
      params.output = job.folder / "plain.ply";
      CHECK(job.run(params).files == std::vector<std::string>{params.output});
      CHECK(bytes_of(report.files[k]) == bytes_of(params.output));
    }
  }
}

TEST_CASE(
    "an animation in memory, with samples that are inserted, begins with the input and ends as a plain job") {
  const JobFolder job;
  put(job.in, wavy_sheet(100));
  JobParams params = job.params(1);
  params.mode = JobMode::kMemory;
  params.request.recipe.edits[0].edit.deformation.steps = {Translation{.vector = {1.0, 0.0, 0.0}}};
  params.request.recipe.edits[0].edit.resampling = ResamplingParams{};
  job.run(params);
  const std::string plain = bytes_of(job.out);
  params.steps = 3;
  const JobReport report = job.run(params);
  CHECK(report.mode == JobMode::kMemory);
  CHECK(report.inserted > 2000);
  REQUIRE(report.files.size() == 3);
  CHECK(cloud_of(report.files[0]).position == cloud_of(job.in).position);
  CHECK(cloud_of(report.files[1]).size() > 10'000);
  CHECK(bytes_of(report.files[2]) == plain);
}

TEST_CASE(
    "an animation that was interrupted goes on from its tiles, not from those of another number of steps") {
  const JobFolder job;
  put(job.in, wavy_sheet(150));
  JobParams params = job.params();
  params.steps = 3;
  std::vector<std::string> undisturbed;
  for (const std::string& file : job.run(params).files) {
    undisturbed.push_back(bytes_of(file));
    std::filesystem::remove(file);
  }
  const auto interrupt = [&] {
    const ExecutionContext context;
    const auto report = run_full_resolution(params, context, [&](const std::string& phase, double) {
      if (phase == "result") context.cancel();
    });
    REQUIRE_FALSE(report.ok());
  };
  interrupt();
  const JobReport report = job.run(params);
  CHECK(report.tiles_kept == report.tiles);
  for (std::size_t k = 0; k < 3; ++k) CHECK(bytes_of(report.files[k]) == undisturbed[k]);
  interrupt();
  params.steps = 4;
  CHECK(job.run(params).tiles_kept == 0);
}

TEST_CASE("LAS stays on its grid, and what its numbers cannot say is refused") {
  const JobFolder job;
  JobParams params = job.params();
  params.input = job.folder / "in.las";
  params.output = job.folder / "out.las";
  // Whole numbers of 1/1024 leave room for what the edits do; the finest grid that holds the sheet does not.
  Cloud sheet = wavy_sheet(120);
  for (std::size_t i = 0; i < sheet.size(); ++i)
    sheet.position.set(i, (sheet.position[i].array() * 1024.0F).round() / 1024.0F);
  put(params.input, sheet, CloudFormat::kLas,
      {.grid = PositionGrid{.scale = Vec3d::Constant(1.0 / 1024.0), .offset = Vec3d::Zero()}});
  const JobReport report = job.run(params);
  CHECK(report.mode == JobMode::kTiles);
  CHECK(report.moved > 5000);
  const Cloud before = cloud_of(params.input);
  const Cloud after = cloud_of(params.output);
  REQUIRE(after.size() == before.size());
  for (std::size_t i = 0; i < before.size(); ++i)
    if (before.position[i].x() < 0.25F) CHECK(model_position(after, i) == model_position(before, i));
  // The header says how far they reach now: greatest and least x, y and z.
  Vec3d least = model_position(after, 0);
  Vec3d greatest = least;
  for (std::size_t i = 0; i < after.size(); ++i) {
    least = least.cwiseMin(model_position(after, i));
    greatest = greatest.cwiseMax(model_position(after, i));
  }
  const std::string header = bytes_of(params.output).substr(179, 48);
  std::array<double, 6> bounds{};
  std::memcpy(bounds.data(), header.data(), sizeof bounds);
  for (int axis = 0; axis < 3; ++axis) {
    CHECK(bounds.at(static_cast<std::size_t>(2 * axis)) == doctest::Approx(greatest[axis]).epsilon(1e-9));
    CHECK(bounds.at(static_cast<std::size_t>(2 * axis + 1)) == doctest::Approx(least[axis]).epsilon(1e-9));
  }
  std::filesystem::remove(params.output);
  params.request.recipe.edits[0].edit.deformation.steps = {Translation{.vector = {0.0, 0.0, 1e8}}};
  params.request.recipe.edits.resize(1);
  CHECK(job.refused(params).detail.find("whole numbers") != std::string::npos);
}

TEST_CASE(
    "other formats are made in memory, resampling there as well, on levels of their own where asked for") {
  const JobFolder job;
  put(job.in, wavy_sheet(100));
  JobParams params = job.params();
  params.output = job.folder / "out.drc";
  CHECK(job.run(params).mode == JobMode::kMemory);
  CHECK(cloud_of(params.output).size() == 10'000);

  params.output = job.out;
  params.mode = JobMode::kMemory;
  params.request.recipe.edits[0].edit.deformation.steps = {Translation{.vector = {1.0, 0.0, 0.0}}};
  params.request.recipe.edits[0].edit.resampling = ResamplingParams{};
  const JobReport stretched = job.run(params);
  CHECK(stretched.mode == JobMode::kMemory);
  CHECK(stretched.inserted > 2000);
  const Cloud made = cloud_of(job.out);
  CHECK(made.size() == 10'000 + stretched.inserted);
  CHECK(made.color.size() == made.size());

  std::filesystem::remove(job.out);
  params.request = lifting();
  params.mode = JobMode::kDirect;
  const JobReport direct = job.run(params);
  CHECK(direct.rms_difference > 0.0);
  CHECK(direct.rms_difference < 0.5 * direct.spacing);
}

TEST_CASE("jobs refuse what they cannot do, and leave nothing behind") {
  const JobFolder job;
  put(job.in, wavy_sheet(100));
  JobParams params = job.params();
  params.mode = JobMode::kTiles;
  params.input = job.folder / "text.xyz";
  put(params.input, wavy_sheet(50), CloudFormat::kXyz);
  CHECK(job.refused(params).kind == ProblemKind::kUnsupportedFormat);

  params.input = job.folder / "cut.ply";
  put(params.input, bytes_of(job.in).substr(0, 5000));
  CHECK(job.refused(params).kind == ProblemKind::kMalformedCloud);

  std::string with_nan = odd_ply(40);
  const std::size_t x_of_first = with_nan.find("end_header\n") + 11 + 1 + 8 + 12;
  with_nan.replace(x_of_first, 8, std::string("\x7f\xf8\0\0\0\0\0\0", 8));
  params.input = job.folder / "nan.ply";
  put(params.input, with_nan);
  const protocol::Problem not_finite = job.refused(params);
  CHECK(not_finite.kind == ProblemKind::kNonFinite);
  CHECK(not_finite.detail.find("sample 0") != std::string::npos);

  params.input = job.folder / "absent.ply";
  CHECK(job.refused(params).detail.find("absent.ply") != std::string::npos);

  params = job.params();
  params.request.recipe.edits[1].edit.level = 9;
  CHECK(job.refused(params).detail.find("edit 2") != std::string::npos);
  constexpr std::uint32_t kTooMany = protocol::kMostSteps + 1;
  for (const std::uint32_t steps : {0U, 1U, kTooMany}) {
    params = job.params();
    params.steps = steps;
    CHECK(job.refused(params).detail == "steps must lie between 2 and 1000");
  }
  params.steps = 2;
  params.mode = JobMode::kDirect;
  CHECK(job.refused(params).detail.find("direct") != std::string::npos);
  params = job.params();
  params.output = params.input;
  CHECK_FALSE(run_full_resolution(params, ExecutionContext(), [](const std::string&, double) {}).ok());
  CHECK(cloud_of(job.in).size() == 10'000);
}

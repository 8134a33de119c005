// Resampling and collection in tiles: no seam, whole records, and limits of the whole scan.
#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <filesystem>
#include <random>
#include <tuple>

#include "engine/core/parallel.h"
#include "engine/spatial/kd_tree.h"
#include "server/jobs/tile_plan.h"
#include "tests/server/job_folder.h"

using namespace pointwright;
using namespace pointwright::server;
using namespace pointwright::test;
using protocol::ProblemKind;

namespace {

/// The sheet with its samples off the grid: no two distances are the same.
Cloud uneven_sheet(std::size_t side) {
  Cloud sheet = wavy_sheet(side);
  std::mt19937 random(7);
  std::uniform_real_distribution<float> offset(-0.3F / static_cast<float>(side),
                                               0.3F / static_cast<float>(side));
  for (std::size_t i = 0; i < sheet.size(); ++i)
    sheet.position.set(i, sheet.position[i] + Vec3f(offset(random), offset(random), 0.1F * offset(random)));
  return sheet;
}

/// Pulls the right of the sheet away, then squeezes it together again, each with resampling and collection.
protocol::RecipeRequest pulling(bool collects) {
  protocol::RecipeRequest request = lifting();
  const ResamplingParams resampling{.sweeps = 4, .collect = collects ? 0.6 : 0.0};
  for (protocol::RecipeEdit& edit : request.recipe.edits) edit.edit.resampling = resampling;
  request.recipe.edits[0].edit.deformation.steps = {Translation{.vector = {0.8, 0.0, 0.1}}};
  request.recipe.edits[1].edit.deformation.steps = {Translation{.vector = {collects ? -1.0 : 0.3, 0.1, 0.0}}};
  return request;
}

std::size_t header_bytes(const std::string& ply) {
  return ply.find("end_header\n") + 11;
}

/// Floats beside whole numbers, a colour of 16 bits and texture coordinates with a seam.
std::string rich_ply(const Cloud& cloud) {
  std::string text =
      "ply\nformat binary_little_endian 1.0\ncomment by X\relement vertex 77\nelement  vertex " +
      std::to_string(cloud.size()) +
      "\nproperty float x\nproperty float y\nproperty float z\nproperty uint label\n"
      "property float height\nproperty double time\nproperty ushort red\nproperty ushort green\n"
      "property ushort blue\nproperty float u\nproperty float v\nend_header\n";
  const auto append = [&](auto value) { text.append(reinterpret_cast<const char*>(&value), sizeof value); };
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const Vec3f p = cloud.position[i];
    append(p.x());
    append(p.y());
    append(p.z());
    append(static_cast<std::uint32_t>(i));
    append(p.x());                             // height
    append(2.0 * static_cast<double>(p.y()));  // time
    append(static_cast<std::uint16_t>(std::clamp(60'000.0F * p.x(), 0.0F, 60'000.0F)));
    append(std::uint16_t{5});
    append(std::uint16_t{6});
    append(p.y() < 0.5F ? p.x() : p.x() + 10.0F);
    append(p.y());
  }
  return text;
}

}  // namespace

TEST_CASE(
    "resampling in tiles leaves no seam: the bytes are those of a single tile, with any number of threads") {
  const JobFolder job;
  for (const bool is_even : {true, false})
    for (const bool collects : {false, true}) {
      CAPTURE(is_even);
      CAPTURE(collects);
      put(job.in, is_even ? wavy_sheet(220) : uneven_sheet(220));
      JobParams params = job.params();
      params.request = pulling(collects);
      params.mode = JobMode::kTiles;
      const JobReport many = job.run(params);
      CHECK(many.tiles >= 8);
      CHECK(many.inserted > 5000);
      CHECK((many.removed > 0) == collects);
      const std::string expected = bytes_of(job.out);
      const Cloud made = cloud_of(job.out);
      CHECK(made.size() == 48'400 + many.inserted - many.removed);
      params.memory_bytes = std::uint64_t{1} << 30U;
      const JobReport few = job.run(params);
      CHECK(few.tiles < many.tiles);
      CHECK(bytes_of(job.out) == expected);
      params.memory_bytes = std::uint64_t{1} << 34U;
      with_threads(3, [&] { CHECK(job.run(params).tiles == 1); });
      CHECK(bytes_of(job.out) == expected);
    }
}

TEST_CASE("resampling in tiles and in memory make the same samples") {
  const JobFolder job;
  const Cloud sheet = uneven_sheet(160);
  put(job.in, sheet);
  std::vector<std::uint32_t> every;
  for (std::uint32_t i = 0; i < sheet.size(); i += 8) every.push_back(i);
  JobParams params = job.params();
  params.preview = std::make_shared<const Cloud>(permuted(sheet, every));
  params.request = pulling(true);
  params.mode = JobMode::kMemory;
  const JobReport whole = job.run(params);
  const Cloud expected = cloud_of(job.out);
  params.mode = JobMode::kTiles;
  const JobReport tiled = job.run(params);
  const Cloud made = cloud_of(job.out);
  CHECK(tiled.tiles > 4);
  CHECK(tiled.inserted == whole.inserted);
  CHECK(tiled.removed == whole.removed);
  CHECK(static_cast<double>(tiled.matched) ==
        doctest::Approx(static_cast<double>(whole.matched)).epsilon(0.01));
  CHECK(tiled.rms_difference == doctest::Approx(whole.rms_difference).epsilon(0.02));
  REQUIRE(made.size() == expected.size());
  const auto all = [](const Cloud& cloud) {
    std::vector<std::tuple<float, float, float, Rgba>> samples;
    for (std::size_t i = 0; i < cloud.size(); ++i)
      samples.emplace_back(cloud.position[i].x(), cloud.position[i].y(), cloud.position[i].z(),
                           cloud.color[i]);
    std::sort(samples.begin(), samples.end());
    return samples;
  };
  const auto here = all(made);
  const auto there = all(expected);
  std::size_t elsewhere = 0;
  int worst = 0;
  for (std::size_t i = 0; i < here.size(); ++i) {
    const auto& [x, y, z, color] = here[i];
    const auto& [x_there, y_there, z_there, color_there] = there[i];
    if (std::tuple(x, y, z) != std::tuple(x_there, y_there, z_there)) ++elsewhere;
    for (std::size_t channel = 0; channel < 3; ++channel)
      worst = std::max(worst, std::abs(int{color[channel]} - int{color_there[channel]}));
  }
  CHECK(elsewhere == 0);
  CHECK(worst <= 2);  // tiles round colours once, at the end
}

TEST_CASE(
    "inserted samples have whole records: floats and colours lie between, whole numbers are a neighbour's") {
  const JobFolder job;
  const Cloud sheet = uneven_sheet(150);
  put(job.in, rich_ply(sheet));
  JobParams params = job.params(1);
  params.request = pulling(false);
  params.request.recipe.edits.resize(1);
  const JobReport report = job.run(params);
  CHECK(report.mode == JobMode::kTiles);
  CHECK(report.tiles > 4);
  const std::string before = bytes_of(job.in);
  const std::string after = bytes_of(job.out);
  CHECK(after.find("element  vertex " + std::to_string(22'500 + report.inserted) + "\n") !=
        std::string::npos);
  constexpr std::size_t kRecord = 12 + 4 + 4 + 8 + 6 + 8;
  REQUIRE(after.size() == header_bytes(after) + (22'500 + report.inserted) * kRecord);
  const auto value = [&](const std::string& bytes, std::size_t record, std::size_t byte, auto zero) {
    std::memcpy(&zero, bytes.data() + header_bytes(bytes) + record * kRecord + byte, sizeof zero);
    return zero;
  };
  // Samples keep their places and, but for where they stand, their bytes.
  for (std::size_t i = 0; i < 22'500; ++i)
    CHECK(before.compare(header_bytes(before) + i * kRecord + 12, kRecord - 12, after,
                         header_bytes(after) + i * kRecord + 12, kRecord - 12) == 0);
  std::size_t between = 0;
  std::size_t astray = 0;
  std::size_t mixed = 0;
  const double spacing = 1.0 / 150;
  for (std::size_t i = 22'500; i < 22'500 + report.inserted; ++i) {
    const auto label = value(after, i, 12, std::uint32_t{});
    REQUIRE(label < 22'500);
    const Vec3f whose = sheet.position[label];
    const auto height = static_cast<double>(value(after, i, 16, float{}));
    const double time = value(after, i, 20, double{});
    if (std::abs(height - static_cast<double>(whose.x())) > 1e-6) ++between;
    if (std::abs(height - static_cast<double>(whose.x())) > 2.0 * spacing ||
        std::abs(time / 2.0 - static_cast<double>(whose.y())) > 2.0 * spacing)
      ++astray;
    CHECK(value(after, i, 28, std::uint16_t{}) == doctest::Approx(60'000.0 * height).epsilon(0.001));
    CHECK(value(after, i, 30, std::uint16_t{}) == 5);
    // No texture coordinate lies between the two sides of the seam.
    const auto u = static_cast<double>(value(after, i, 34, float{}));
    if (u > height + 0.1 && u < height + 9.9) ++mixed;
  }
  CHECK(between > report.inserted / 2);
  CHECK(astray == 0);
  CHECK(mixed == 0);
}

TEST_CASE("LAS counts what was inserted and removed, in its header and by returns") {
  const JobFolder job;
  JobParams params = job.params();
  params.input = job.folder / "in.las";
  params.output = job.folder / "out.las";
  Cloud sheet = uneven_sheet(150);
  // The finest grid that holds the sheet leaves no room for what the edits do.
  for (std::size_t i = 0; i < sheet.size(); ++i)
    sheet.position.set(i, (sheet.position[i].array() * 1048576.0F).round() / 1048576.0F);
  for (const bool is_modern : {false, true}) {
    CAPTURE(is_modern);
    std::vector<std::uint8_t> returns(sheet.size());
    for (std::size_t i = 0; i < returns.size(); ++i) returns[i] = static_cast<std::uint8_t>(1 + i % 3);
    sheet.scalars = {{.name = "return_number", .values = returns}};
    if (is_modern)
      sheet.scalars.push_back({.name = "nir", .values = std::vector<std::uint16_t>(sheet.size(), 4)});
    put(params.input, sheet, CloudFormat::kLas,
        {.grid = PositionGrid{.scale = Vec3d::Constant(1.0 / 1048576.0), .offset = Vec3d::Zero()}});
    if (is_modern) {
      // As some programs write them: the older fields count as well, where they should say nothing.
      std::string bytes = bytes_of(params.input);
      const std::string count("\xe4\x57\0\0", 4);  // 22,500
      put(params.input, bytes.replace(107, 4, count).replace(111, 4, count));
    }
    params.request = pulling(true);
    const JobReport report = job.run(params);
    CHECK(report.mode == JobMode::kTiles);
    CHECK(report.inserted > 1000);
    CHECK(report.removed > 0);
    const Cloud after = cloud_of(params.output);
    CHECK(after.size() == sheet.size() + report.inserted - report.removed);
    std::array<std::uint64_t, 3> counted{};
    for (const ScalarAttribute& scalar : after.scalars)
      if (scalar.name == "return_number")
        for (const std::uint8_t number : std::get<std::vector<std::uint8_t>>(scalar.values))
          ++counted.at(number - 1U);
    const std::string head = bytes_of(params.output).substr(0, 375);
    const auto at = [&](std::size_t byte, auto zero) {
      std::memcpy(&zero, head.data() + byte, sizeof zero);
      return static_cast<std::uint64_t>(zero);
    };
    REQUIRE((head[25] == 4) == is_modern);
    CHECK(at(107, std::uint32_t{}) == (is_modern ? 0 : after.size()));
    for (std::size_t k = 0; k < 3; ++k)
      CHECK((is_modern ? at(255 + 8 * k, std::uint64_t{}) : at(111 + 4 * k, std::uint32_t{})) ==
            counted.at(k));
    if (is_modern) CHECK(at(247, std::uint64_t{}) == after.size());
    if (is_modern) CHECK(at(111, std::uint32_t{}) == 0);
    std::filesystem::remove(params.output);
  }
}

TEST_CASE("an animation in tiles inserts in each step what a plain job does there") {
  const JobFolder job;
  put(job.in, uneven_sheet(120));
  JobParams params = job.params();
  params.request = pulling(true);
  params.steps = 3;
  const JobReport report = job.run(params);
  CHECK(report.mode == JobMode::kTiles);
  REQUIRE(report.files.size() == 3);
  CHECK(bytes_of(report.files[0]) == bytes_of(job.in));
  params.steps = std::nullopt;
  for (const double s : {0.5, 1.0}) {
    params.request.s = s;
    params.output = job.folder / "plain.ply";
    CHECK(job.run(params).inserted > 500);
    CHECK(bytes_of(report.files[s == 1.0 ? 2 : 1]) == bytes_of(params.output));
  }
}

TEST_CASE("the samples that an edit may leave are those of the whole scan") {
  const JobFolder job;
  put(job.in, uneven_sheet(120));
  JobParams params = job.params();
  params.request = pulling(false);
  const JobReport free = job.run(params);
  const std::uint64_t count = 14'400 + free.inserted;
  const std::string expected = bytes_of(job.out);
  std::filesystem::remove(job.out);
  params.request.recipe.edits[1].edit.resampling->max_samples = static_cast<std::uint32_t>(count - 1);
  const protocol::Problem problem = job.refused(params);
  CHECK(problem.kind == ProblemKind::kTooManySamples);
  CHECK(problem.actual == static_cast<double>(count));
  // Tiles of that job are not taken for those of another limit.
  params.request.recipe.edits[1].edit.resampling->max_samples = static_cast<std::uint32_t>(count);
  CHECK(job.run(params).tiles_kept == 0);
  CHECK(bytes_of(job.out) == expected);
}

TEST_CASE("where samples become many in one place, tiles that memory does not hold are refused") {
  constexpr std::size_t kSide = 200;
  constexpr std::uint64_t kSamples = 100'000'000;
  const auto planned = [](const auto& is_strong, std::uint64_t memory) {
    PlayedSteps played;
    played.rest = wavy_sheet(kSide).position;
    played.script.bases.bands.resize(1);
    PlayedSteps::Step step;
    step.edits.resize(1);
    step.edits.front().params.resampling = ResamplingParams{.sweeps = 4};
    for (std::size_t i = 0; i < played.rest.size(); ++i)
      step.families.push_back(is_strong(i / kSide, i % kSide) ? 64 : 1);
    played.steps.push_back(step);
    return plan_tiles(played, kSamples, 10, 0, memory);
  };
  const auto in_one_place = [](std::size_t row, std::size_t column) { return row < 20 && column < 20; };
  const auto scattered = [](std::size_t row, std::size_t column) {
    return row % 10 == 0 && column % 10 == 0;
  };

  constexpr std::uint64_t kMemory = std::uint64_t{512} << 20U;
  CHECK(planned(scattered, kMemory).ok());
  const auto refused = planned(in_one_place, kMemory);
  REQUIRE_FALSE(refused.ok());
  CHECK(refused.problem().kind == ProblemKind::kOutOfSpace);
  REQUIRE(refused.problem().actual.has_value());
  CHECK(*refused.problem().actual > static_cast<double>(kMemory));
  // What the refusal asks for is enough, and no less is.
  const auto asked = static_cast<std::uint64_t>(*refused.problem().actual);
  const auto enough = planned(in_one_place, asked);
  REQUIRE(enough.ok());
  CHECK(enough.value().lanes == 1);
  CHECK_FALSE(planned(in_one_place, asked - 10'000).ok());
  CHECK(planned(in_one_place, 2 * asked).value().lanes == 2);
}

TEST_CASE("a file whose faces count its samples is resampled in memory, without them") {
  const JobFolder job;
  std::string mesh = rich_ply(uneven_sheet(60));
  mesh.insert(mesh.find("end_header"), "element face 1\nproperty list uchar int vertex_indices\n");
  mesh.append("\x03\0\0\0\0\x01\0\0\0\x02\0\0\0", 13);
  put(job.in, mesh);
  JobParams params = job.params();
  CHECK(job.run(params).mode == JobMode::kTiles);
  params.request = pulling(false);
  CHECK(job.run(params).mode == JobMode::kMemory);
  CHECK(bytes_of(job.out).find("element face") == std::string::npos);
  std::filesystem::remove(job.out);
  params.mode = JobMode::kTiles;
  CHECK(job.refused(params).detail.find("faces") != std::string::npos);
}

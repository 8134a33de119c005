#include "protocol/frames/frame.h"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "engine/core/parallel.h"
#include "engine/core/simd_dispatch.h"
#include "tests/protocol/golden.h"

using namespace pointwright;
using namespace pointwright::protocol;

namespace {

constexpr std::uint16_t kEverything = kAllFrameAttributes;

FrameState full_state() {
  return {.level = 2,
          .revision = 11,
          .sequence = 12,
          .origin = Vec3d(1e6, -2e6, 3.0),
          .detail_range = 1.0F,
          .stretch_range = 4.0F};
}

FrameBytes key_of(const golden::Columns& columns, std::uint32_t block_size,
                  std::uint16_t attributes = kEverything) {
  FrameBytes bytes;
  encode_key_frame(FrameLayout(static_cast<std::uint32_t>(columns.position.size()), block_size),
                   columns.view(), full_state(), attributes, bytes);
  return bytes;
}

DecodedFrame decoded(const FrameBytes& bytes) {
  auto frame = decode_frame(bytes);
  REQUIRE_MESSAGE(frame.ok(), (frame.ok() ? "" : frame.error().message));
  return std::move(frame).value();
}

/// Calls check(sample, block, lane) for every sample of the frame.
template <typename Check>
std::size_t for_samples(const FrameLayout& layout, const DecodedFrame& frame, const Check& check) {
  std::size_t count = 0;
  for (const DecodedBlock& block : frame.blocks) {
    const SampleRange samples = layout.block_samples(block.number);
    REQUIRE(samples.count == block.count);
    for (std::uint32_t lane = 0; lane < block.count; ++lane, ++count) {
      check(samples.begin + lane * samples.stride, block, lane);
    }
  }
  return count;
}

}  // namespace

TEST_CASE("a key frame gives back every sample within half a quantisation step") {
  for (const std::uint32_t count : {1U, 15U, 16U, 17U, 150U, 5000U}) {
    const golden::Columns columns(count);
    const FrameLayout layout(count, 512);
    const DecodedFrame frame = decoded(key_of(columns, 512));
    CHECK(frame.header.kind == FrameKind::kKey);
    CHECK(frame.header.level == 2);
    CHECK(frame.header.revision == 11);
    CHECK(frame.header.sequence == 12);
    CHECK(frame.header.sample_count == count);
    CHECK(frame.header.origin == full_state().origin);
    const std::size_t seen =
        for_samples(layout, frame, [&](std::uint32_t i, const DecodedBlock& block, std::uint32_t lane) {
          const Vec3d relative = decode_positions(frame.header, block)[lane] - frame.header.origin;
          const Vec3d error = (relative - columns.position[i].cast<double>()).cwiseAbs();
          // Half a step, and the float32 rounding of the box's own corner and extent; 1e6 of origin costs
          // 1e-10 more.
          const Vec3d bound = block.extent.cast<double>() * (0.501 / 65535.0) + Vec3d::Constant(2e-4);
          REQUIRE((error.array() <= bound.array()).all());
          REQUIRE(block.color[lane] == columns.color[i]);
          REQUIRE(block.marks[lane] == columns.marks[i]);
          REQUIRE(block.ids[lane] == columns.ids[i]);
          REQUIRE(block.radius[lane] == columns.radius[i]);
          REQUIRE(std::abs(static_cast<float>(block.position_t[lane][3]) / 65535.0F - columns.t[i]) <=
                  0.51F / 65535.0F);
          const float detail = static_cast<float>(block.detail[lane]) / 32767.0F;
          REQUIRE(std::abs(detail - std::clamp(columns.detail[i], -1.0F, 1.0F)) <= 0.51F / 32767.0F);
          REQUIRE(std::abs(static_cast<float>(block.stretch[lane]) / 65535.0F * 4.0F - columns.stretch[i]) <=
                  4.0F * 0.51F / 65535.0F);
        });
    CHECK(seen == count);
  }
}

TEST_CASE("octahedral normals come back within 0.006 degrees, the axes exactly") {
  std::mt19937 random(7);
  std::normal_distribution<float> gauss;
  golden::Columns columns(20'000);
  for (std::uint32_t i = 0; i < 20'000; ++i) {
    columns.normal.set(i, Vec3f(gauss(random), gauss(random), gauss(random)).normalized());
  }
  for (int axis = 0; axis < 3; ++axis) {
    columns.normal.set(static_cast<std::size_t>(2 * axis), Vec3f::Unit(axis));
    columns.normal.set(static_cast<std::size_t>(2 * axis + 1), -Vec3f::Unit(axis));
  }
  columns.normal.set(6, Vec3f(-0.0F, -0.0F, -1.0F));
  columns.normal.set(7, Vec3f(0.6F, 0.8F, -0.0F));
  const FrameLayout layout(20'000);
  const DecodedFrame frame = decoded(key_of(columns, kDefaultBlockSize, kFrameNormal));
  double worst = 0.0;
  for (const DecodedBlock& block : frame.blocks) {
    const SampleRange samples = layout.block_samples(block.number);
    const std::vector<Vec3f> normals = decode_normals(block);
    for (std::uint32_t lane = 0; lane < block.count; ++lane) {
      const std::uint32_t i = samples.begin + lane * samples.stride;
      const Vec3f expected = columns.normal[i];
      REQUIRE(std::abs(normals[lane].norm() - 1.0F) < 1e-6F);
      worst = std::max(worst, static_cast<double>((normals[lane] - expected).norm()));
      if (i < 7) CHECK((normals[lane] - expected).norm() == 0.0F);
    }
  }
  // A step of 1 / 32767 in a map that stretches by at most sqrt(3) leaves sqrt(2) / 2 steps of rounding
  // error.
  CHECK(worst < 1e-4);
}

TEST_CASE("t of 0 and 1, and the ends of a box, are exact") {
  golden::Columns columns(64);
  for (std::uint32_t i = 0; i < 64; ++i) {
    columns.position.set(i, Vec3f::Constant(static_cast<float>(i % 2)));
    columns.t[i] = static_cast<float>(i / 32 % 2);
  }
  const DecodedFrame frame = decoded(key_of(columns, 4096, kFrameT));
  const FrameLayout layout(64, 4096);
  for_samples(layout, frame, [&](std::uint32_t i, const DecodedBlock& block, std::uint32_t lane) {
    CHECK(block.position_t[lane][3] == (i / 32 % 2 == 0 ? 0 : 65535));
    const Vec3d position = decode_positions(frame.header, block)[lane] - frame.header.origin;
    CHECK(position == Vec3d::Constant(i % 2));
  });
}

TEST_CASE("absent columns are left out, absent scalars are zero") {
  golden::Columns columns(100);
  FrameColumns view{.position = &columns.position};
  FrameBytes bytes;
  encode_key_frame(FrameLayout(100, 32), view, full_state(), kFrameT | kFrameDetail, bytes);
  const DecodedFrame frame = decoded(bytes);
  for (const DecodedBlock& block : frame.blocks) {
    for (const auto& q : block.position_t) CHECK(q[3] == 0);
    CHECK(std::all_of(block.detail.begin(), block.detail.end(), [](auto d) { return d == 0; }));
    CHECK(std::all_of(block.stretch.begin(), block.stretch.end(), [](auto s) { return s == 0; }));
    CHECK(block.normal.empty());
    CHECK(block.ids.empty());
  }
  CHECK_THROWS_AS(encode_key_frame(FrameLayout(100, 32), view, full_state(), kFrameNormal, bytes),
                  LogicError);
  CHECK_THROWS_AS(encode_key_frame(FrameLayout(100, 32), view, full_state(), kFrameIds, bytes), LogicError);
  CHECK_THROWS_AS(encode_key_frame(FrameLayout(101, 32), view, full_state(), 0, bytes), LogicError);
}

TEST_CASE("degenerate clouds encode: none, one, coincident, flat, tiny, huge and zero normals") {
  SUBCASE("no sample") {
    CHECK(key_of(golden::Columns(0), 4096).size() == kFrameHeaderBytes);
    CHECK(decoded(key_of(golden::Columns(0), 4096)).header.bounds.radius == 0.0F);
  }
  SUBCASE("all samples in one place") {
    golden::Columns columns(300);
    for (std::uint32_t i = 0; i < 300; ++i) columns.position.set(i, Vec3f(3.5F, -2.25F, 1e9F));
    const DecodedFrame frame = decoded(key_of(columns, 64));
    for (const DecodedBlock& block : frame.blocks) {
      CHECK(block.extent == Vec3f::Zero());
      for (const Vec3d& p : decode_positions(frame.header, block)) {
        CHECK(p - frame.header.origin == Vec3d(3.5, -2.25, 1e9));
      }
    }
  }
  SUBCASE("extents so small that their reciprocal overflows") {
    golden::Columns columns(2);
    columns.position.set(0, Vec3f::Zero());
    columns.position.set(1, Vec3f::Constant(1e-40F));
    for (const DecodedBlock& block : decoded(key_of(columns, 64)).blocks) CHECK(block.extent.allFinite());
  }
  SUBCASE("coordinates at the limit of 1e9 on both sides") {
    golden::Columns columns(64);
    for (std::uint32_t i = 0; i < 64; ++i)
      columns.position.set(i, Vec3f::Constant(i % 2 == 0 ? 1e9F : -1e9F));
    const DecodedFrame frame = decoded(key_of(columns, 64));
    CHECK(frame.header.bounds.radius == doctest::Approx(std::sqrt(3.0) * 1e9));
  }
  SUBCASE("normals of length zero decode to a unit vector") {
    golden::Columns columns(20);
    for (std::uint32_t i = 0; i < 20; ++i) columns.normal.set(i, Vec3f::Zero());
    const DecodedFrame frame = decoded(key_of(columns, 64));
    for (const DecodedBlock& block : frame.blocks) {
      for (const Vec3f& normal : decode_normals(block)) CHECK(normal == Vec3f::UnitZ());
    }
  }
}

TEST_CASE("frames are the same bytes for any thread count, on every instruction set and in a used buffer") {
  const golden::Columns columns(60'001);
  FrameBytes reference;
  with_threads(1, [&] { reference = key_of(columns, 1024); });
  const SimdLevel best = simd_level();
  for (const int threads : {2, 3, 8}) {
    for (const SimdLevel level : {SimdLevel::kBase, SimdLevel::kV3, SimdLevel::kV4}) {
      set_simd_level(level);
      FrameBytes bytes(123'456, std::byte{0xAA});
      with_threads(threads, [&] {
        encode_key_frame(FrameLayout(60'001, 1024), columns.view(), full_state(), kEverything, bytes);
      });
      CHECK((bytes == reference));
    }
  }
  set_simd_level(best);
}

TEST_CASE("the bounds are the ball around the bounding box, in keys and deltas alike") {
  const golden::Columns columns(5000);
  const SurfaceBounds ball = surface_bounds(columns.position);
  const Box3f box = bounds_of(columns.position);
  CHECK((ball.center - (box.min + box.max) / 2).norm() <= 1e-3F);
  CHECK(ball.radius == doctest::Approx(box.diagonal() / 2));
  CHECK(decoded(key_of(columns, 256)).header.bounds.radius == ball.radius);
  FrameBytes bytes;
  encode_delta_frame(FrameLayout(5000, 256), columns.view(), full_state(), 0, {}, bytes);
  CHECK(decoded(bytes).header.bounds.radius == ball.radius);
  CHECK(decoded(bytes).blocks.empty());
  FrameState state = full_state();
  state.bounds = SurfaceBounds{.center = Vec3f(1, 2, 3), .radius = 9.0F};
  encode_key_frame(FrameLayout(5000, 256), columns.view(), state, 0, bytes);
  CHECK(decoded(bytes).header.bounds.radius == 9.0F);
}

TEST_CASE("radii come within half a step of bfloat16, and in key frames only") {
  golden::Columns columns(100);
  for (std::uint32_t i = 0; i < 100; ++i)
    columns.radius[i] = to_bfloat16(std::exp(static_cast<float>(i) - 50.0F));
  for_samples(FrameLayout(100, 32), decoded(key_of(columns, 32)),
              [&](std::uint32_t i, const DecodedBlock& block, std::uint32_t lane) {
                const float exact = std::exp(static_cast<float>(i) - 50.0F);
                CHECK(std::abs(from_bfloat16(block.radius[lane]) - exact) <= exact / 256.0F);
              });
  CHECK(to_bfloat16(1.00390625F) == 0x3F80);  // a tie: to the even one
  CHECK(to_bfloat16(1.01171875F) == 0x3F82);
  CHECK(to_bfloat16(0.0F) == 0);
  FrameBytes bytes;
  const std::vector<std::uint32_t> blocks{1};
  encode_delta_frame(FrameLayout(100, 32), columns.view(), full_state(), kEverything, blocks, bytes);
  const DecodedFrame delta = decoded(bytes);
  CHECK(delta.header.attributes == (kEverything & ~kFrameRadius));
  CHECK(delta.blocks.at(0).radius.empty());
}

TEST_CASE("a delta holds exactly the blocks that changed, encoded as in a key") {
  const golden::Columns before(20'000);
  const FrameLayout layout(20'000, 512);
  const std::vector<std::uint32_t> samples{0, 17, 4096, 19'999};
  golden::Columns after(20'000);
  std::vector<std::uint32_t> expected;
  for (const std::uint32_t i : samples) expected.push_back(layout.block_of_sample(i));
  std::sort(expected.begin(), expected.end());
  expected.erase(std::unique(expected.begin(), expected.end()), expected.end());

  SUBCASE("positions") {
    for (const std::uint32_t i : samples) after.position.set(i, after.position[i] + Vec3f(0, 0, 1e-3F));
  }
  SUBCASE("normals") {
    for (const std::uint32_t i : samples) after.normal.set(i, -after.normal[i]);
  }
  SUBCASE("marks") {
    for (const std::uint32_t i : samples) after.marks[i] = static_cast<std::uint8_t>(after.marks[i] ^ 1U);
  }
  SUBCASE("t") {
    for (const std::uint32_t i : samples) after.t[i] = 0.123F;
  }
  const auto blocks = changed_blocks(layout, before.view(), after.view(), kEverything);
  CHECK(blocks == expected);
  FrameBytes bytes;
  encode_delta_frame(layout, after.view(), full_state(), kEverything, blocks, bytes);
  const DecodedFrame delta = decoded(bytes);
  const DecodedFrame key = decoded(key_of(after, 512));
  REQUIRE(delta.blocks.size() == expected.size());
  for (const DecodedBlock& block : delta.blocks) {
    const auto same = std::find_if(key.blocks.begin(), key.blocks.end(),
                                   [&](const DecodedBlock& other) { return other.number == block.number; });
    REQUIRE(same != key.blocks.end());
    CHECK(same->position_t == block.position_t);
    CHECK(same->normal == block.normal);
    CHECK(same->marks == block.marks);
  }
}

TEST_CASE("changes that a frame does not carry change no block; everything moved changes all") {
  const golden::Columns before(5000);
  golden::Columns after(5000);
  for (auto& color : after.color) color[0] = static_cast<std::uint8_t>(255 - color[0]);
  const FrameLayout layout(5000, 128);
  CHECK(changed_blocks(layout, before.view(), after.view(), kFrameNormal | kFrameT).empty());
  CHECK(changed_blocks(layout, before.view(), after.view(), kFrameColor).size() == layout.block_count());
  CHECK(changed_blocks(layout, before.view(), before.view(), kEverything).empty());
  FrameColumns without_t = before.view();
  without_t.t = {};
  CHECK(changed_blocks(layout, before.view(), without_t, kFrameT).size() == layout.block_count());
}

TEST_CASE("encoders refuse what would make a bad frame") {
  const golden::Columns columns(100);
  const FrameLayout layout(100, 32);
  FrameBytes bytes;
  const std::vector<std::uint32_t> descending{2, 1};
  const std::vector<std::uint32_t> repeated{1, 1};
  const std::vector<std::uint32_t> beyond{layout.block_count()};
  for (const auto& blocks : {descending, repeated, beyond}) {
    CHECK_THROWS_AS(encode_delta_frame(layout, columns.view(), {}, 0, blocks, bytes), LogicError);
  }
  CHECK_THROWS_AS(encode_key_frame(layout, columns.view(), {}, 128, bytes), LogicError);
  CHECK_THROWS_AS(encode_key_frame(layout, columns.view(), {.sequence = kMaxSequence + 1}, 0, bytes),
                  LogicError);
  CHECK(key_frame_bytes(layout, kEverything) == key_of(columns, 32).size());
}

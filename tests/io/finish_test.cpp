#include <doctest/doctest.h>

#include <cmath>
#include <limits>

#include "engine/core/parallel.h"
#include "engine/io/columns.h"
#include "engine/io/decoded_cloud.h"
#include "tests/io/io_support.h"

namespace pointwright::io_test {
namespace {

template <typename T>
Result<ImportedCloud> finish(const std::vector<std::array<T, 3>>& samples, const ImportParams& params = {}) {
  std::array<std::vector<T>, 3> columns;
  for (const auto& sample : samples) {
    for (std::size_t axis = 0; axis < 3; ++axis) columns[axis].push_back(sample[axis]);
  }
  auto assembled = assemble_cloud({{"x", columns[0]}, {"y", columns[1]}, {"z", columns[2]}}, {});
  REQUIRE(assembled.ok());
  return finish_cloud(std::move(assembled).value(), params);
}

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInf = std::numeric_limits<float>::infinity();

TEST_CASE("samples that are not finite are refused with their count and the first of them") {
  const std::vector<std::array<float, 3>> samples{
      {0, 0, 0}, {1, kNan, 0}, {0, 1, 0}, {-kInf, 0, 0}, {1, 1, 1}};
  const auto refused = finish(samples);
  REQUIRE_FALSE(refused.ok());
  CHECK(refused.error().code == ErrorCode::kNonFinite);
  CHECK(refused.error().actual == 2.0);
  CHECK(refused.error().message.find("sample 1") != std::string::npos);
  const auto dropped = finish(samples, {.drop_non_finite = true});
  REQUIRE(dropped.ok());
  CHECK(dropped.value().report.dropped_non_finite == 2);
  CHECK(dropped.value().report.sample_count == 3);
  CHECK(validate(dropped.value().cloud).ok());
  const Cloud ordered = in_caller_order(dropped.value().cloud);
  CHECK(ordered.position[1] == Vec3f(0, 1, 0));
  CHECK(ordered.position[2] == Vec3f(1, 1, 1));
  CHECK(finish<float>({{kNan, 0, 0}}, {.drop_non_finite = true}).error().code == ErrorCode::kEmptyCloud);
}

TEST_CASE("a double that no float can hold is out of range, not infinite") {
  const auto far = finish<double>({{1e300, 0, 0}, {0, 0, 0}});
  REQUIRE_FALSE(far.ok());
  CHECK(far.error().code == ErrorCode::kOutOfRange);
  CHECK(far.error().limit == 1e9);
}

TEST_CASE("coordinates reach a thousand million and no further") {
  CHECK(finish<float>({{1e9F, 0, 0}, {0, 0, 0}}).ok());
  CHECK(finish<double>({{1.0000001e9, 0, 0}, {0, 0, 0}}).error().code == ErrorCode::kOutOfRange);
  CHECK(finish<float>({{0, -3.4e38F, 0}, {0, 3.4e38F, 0}}).error().code == ErrorCode::kOutOfRange);
}

TEST_CASE("an extent too small for its offset is refused by the precision of the file") {
  CHECK(finish<float>({{1e7F, 0, 0}, {1e7F + 16.0F, 0, 0}}).error().code == ErrorCode::kOutOfRange);
  CHECK(finish<float>({{1e6F, 0, 0}, {1e6F + 16.0F, 0, 0}}).ok());
  // A small object in national coordinates: float64 resolves it to a nanometre.
  CHECK(finish<double>({{5648349.5, 0, 0}, {5648350.5, 0, 0}}).ok());
  CHECK(finish<double>({{1e8, 0, 0}, {1e8 + 1e-5, 0, 0}}).error().code == ErrorCode::kOutOfRange);
}

TEST_CASE("one sample, and samples on one place, are clouds") {
  for (const std::size_t count : {1U, 5U}) {
    const auto one = finish(std::vector<std::array<float, 3>>(count, {0.1F, -1e6F, 3.0F}));
    REQUIRE(one.ok());
    CHECK(one.value().report.duplicate_count == count - 1);
    CHECK(one.value().cloud.exact_position.empty());
    CHECK(model_position(one.value().cloud, 0) == Vec3d(static_cast<double>(0.1F), -1e6, 3.0));
  }
  const auto precise = finish<double>({{0.1, 5648349.895035, 0}});
  REQUIRE(precise.ok());
  CHECK(model_position(precise.value().cloud, 0) == Vec3d(0.1, 5648349.895035, 0));
}

TEST_CASE("near zero the origin is zero and float positions keep their bits") {
  const auto cloud = finish<float>({{7.9F, 0, 0}, {6.9F, 0.25F, 0}}).value().cloud;
  CHECK(cloud.origin == Vec3d::Zero());
  CHECK(in_caller_order(cloud).position.x()[0] == 7.9F);
}

TEST_CASE("far from zero float positions are recentred without losing a bit") {
  Random random(5);
  for (const double offset : {1e3, 665187.25, 5.6e6, 1e8}) {
    std::vector<std::array<float, 3>> samples;
    const double extent = offset * 1e-3;
    for (int i = 0; i < 1000; ++i) {
      samples.push_back({static_cast<float>(offset + random.uniform(0, extent)),
                         static_cast<float>(random.uniform(-extent, extent) * 0.1),
                         static_cast<float>(-offset + random.uniform(0, extent))});
    }
    const auto cloud = in_caller_order(finish(samples).value().cloud);
    CHECK(cloud.exact_position.empty());
    CHECK(cloud.origin.x() != 0.0);
    CHECK(cloud.origin.y() == 0.0);  // that axis lies near zero already
    for (std::size_t i = 0; i < samples.size(); ++i) {
      const Vec3d at = model_position(cloud, i);
      REQUIRE(at == Vec3d(static_cast<double>(samples[i][0]), static_cast<double>(samples[i][1]),
                          static_cast<double>(samples[i][2])));
    }
    const Box3f box = bounds_of(cloud.position);
    CHECK(static_cast<double>(box.max.cwiseAbs().maxCoeff()) <= 8 * 2 * extent);
  }
}

TEST_CASE("double positions are kept exactly where float32 around the origin is not enough") {
  const auto coarse = finish<double>({{1000000.5, 2, 3}, {1000001.25, 3, 4}}).value().cloud;
  CHECK(coarse.exact_position.empty());
  CHECK(coarse.position_is_double);
  const auto fine = finish<double>({{1000000.1, 2, 3}, {1000001.2, 3, 4}}).value().cloud;
  REQUIRE(fine.exact_position.size() == 2);
  CHECK(model_position(in_caller_order(fine), 0).x() == 1000000.1);
}

TEST_CASE("duplicates are counted by exact position and kept") {
  CHECK(
      finish<float>({{1, 2, 3}, {0, 0, 0}, {1, 2, 3}, {1, 2, 3}, {0, 0, 0}}).value().report.duplicate_count ==
      3);
  // The same float32, but not the same place.
  const double a = 0.1;
  const double b = std::nextafter(a, 1.0);
  const auto near = finish<double>({{a, 0, 0}, {b, 0, 0}, {a, 0, 0}, {b, 0, 0}, {5, 0, 0}});
  CHECK(near.value().report.duplicate_count == 2);
  CHECK(finish<float>({{0.0F, 0, 0}, {-0.0F, 0, 0}, {1, 0, 0}}).value().report.duplicate_count == 1);
}

TEST_CASE("bounds are the file's own, and the order inside is the same for any number of threads") {
  const ImportedCloud reference = cloud_with_everything(5000, Place::kFarDouble);
  Vec3d low = model_position(reference.cloud, 0);
  Vec3d high = low;
  for (std::size_t i = 0; i < reference.cloud.size(); ++i) {
    low = low.cwiseMin(model_position(reference.cloud, i));
    high = high.cwiseMax(model_position(reference.cloud, i));
  }
  CHECK(reference.report.bounds_min == low);
  CHECK(reference.report.bounds_max == high);
  for (const int threads : {1, 2, 5}) {
    with_threads(threads, [&] {
      CHECK(difference(cloud_with_everything(5000, Place::kFarDouble).cloud, reference.cloud) == "");
    });
  }
}

TEST_CASE("a limit on samples holds for whatever was decoded") {
  CHECK(finish<float>({{1, 2, 3}, {0, 0, 0}, {2, 2, 3}}, {.max_samples = 2}).error().code ==
        ErrorCode::kTooLarge);
}

TEST_CASE("a small object that only the file's own origin resolves leaves as float64") {
  auto assembled = assemble_cloud(
      {{"x", std::vector<float>{0, 1}}, {"y", std::vector<float>{0, 1}}, {"z", std::vector<float>{0, 1}}},
      {});
  REQUIRE(assembled.ok());
  ImportedCloud decoded = std::move(assembled).value();
  decoded.cloud.origin = Vec3d(665000, 5648000, 0);
  const auto finished = finish_cloud(std::move(decoded), {});
  REQUIRE(finished.ok());
  CHECK(finished.value().cloud.position_is_double);
  for (const auto format : {CloudFormat::kPly, CloudFormat::kDraco}) {
    const Cloud again = through(finished.value().cloud, format).cloud;
    CHECK(model_position(in_caller_order(again), 1) == Vec3d(665001, 5648001, 1));
  }
}

}  // namespace
}  // namespace pointwright::io_test

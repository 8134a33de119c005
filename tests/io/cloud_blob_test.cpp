#include "engine/io/cloud_blob.h"

#include <doctest/doctest.h>

#include "tests/io/io_support.h"

namespace pointwright::io_test {
namespace {

TEST_CASE("a cloud and its report come back from a blob to the bit") {
  for (const Place place : {Place::kNearZero, Place::kFarDouble}) {
    ImportedCloud imported = cloud_with_everything(123, place);
    imported.report.encoding = "binary_big_endian";
    imported.report.declared_count = 130;
    imported.report.dropped_non_finite = 7;
    imported.report.from_mesh = true;
    imported.report.skipped = {"element face", "list ü"};
    const auto again = read_cloud_blob(cloud_blob(imported));
    REQUIRE(again.ok());
    CHECK(difference(again.value().cloud, imported.cloud) == "");
    const ImportReport& report = again.value().report;
    CHECK(report.encoding == imported.report.encoding);
    CHECK(report.declared_count == 130);
    CHECK(report.sample_count == 123);
    CHECK(report.dropped_non_finite == 7);
    CHECK(report.from_mesh);
    CHECK(report.position_is_double == imported.report.position_is_double);
    CHECK(report.attributes == imported.report.attributes);
    CHECK(report.skipped == imported.report.skipped);
    CHECK(report.bounds_min == imported.report.bounds_min);
    CHECK(report.bounds_max == imported.report.bounds_max);
  }
}

TEST_CASE("a blob that is cut or longer than it says is refused") {
  auto blob = cloud_blob(cloud_with_everything(3, Place::kFarDouble));
  for (std::size_t length = 0; length < blob.size(); ++length) {
    CHECK_FALSE(read_cloud_blob(std::span(blob).first(length)).ok());
  }
  blob.push_back(std::byte{0});
  CHECK_FALSE(read_cloud_blob(blob).ok());
}

TEST_CASE("flipped bytes in a blob give a sound cloud or an error") {
  const auto whole = cloud_blob(cloud_with_everything(4, Place::kNearDouble));
  Random random(11);
  int refused = 0;
  for (int round = 0; round < 5000; ++round) {
    auto mutant = whole;
    for (std::uint64_t flips = 1 + random.below(4); flips > 0; --flips) {
      mutant[random.below(mutant.size())] = static_cast<std::byte>(random.next());
    }
    const auto read = read_cloud_blob(mutant);
    if (!read.ok()) {
      CHECK(read.error().code == ErrorCode::kMalformedData);
      ++refused;
      continue;
    }
    const Cloud& cloud = read.value().cloud;
    const auto valid = validate(cloud);
    if (!valid.ok()) CHECK(valid.error().code == ErrorCode::kNonFinite);
  }
  CHECK(refused > 0);
}

}  // namespace
}  // namespace pointwright::io_test

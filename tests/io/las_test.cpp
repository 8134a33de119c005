#include <doctest/doctest.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>

#include "engine/io/columns.h"
#include "engine/io/decoded_cloud.h"
#include "engine/io/las.h"
#include "tests/io/io_support.h"

namespace pointwright::io_test {
namespace {

std::vector<std::byte> seed(const std::string& name) {
  std::ifstream file(std::filesystem::path(POINTWRIGHT_CORPUS_DIR) / "las" / name, std::ios::binary);
  return bytes_of(std::string(std::istreambuf_iterator<char>(file), {}));
}

ImportedCloud read(const std::vector<std::byte>& bytes) {
  auto result = read_cloud(bytes, CloudFormat::kLas, {});
  INFO(why(result));
  REQUIRE(result.ok());
  return std::move(result).value();
}

template <typename T>
std::vector<T> values(const Cloud& cloud, const std::string& name) {
  for (const ScalarAttribute& scalar : cloud.scalars) {
    if (scalar.name != name) continue;
    const auto* found = std::get_if<std::vector<T>>(&scalar.values);
    return found == nullptr ? std::vector<T>() : *found;
  }
  return {};
}
using Bytes = std::vector<std::uint8_t>;

template <typename T>
void put(std::vector<std::byte>& bytes, std::size_t at, T value) {
  std::memcpy(bytes.data() + at, &value, sizeof(T));
}

// Positions from these, as float64.
Cloud cloud_at(const std::vector<std::array<double, 3>>& places) {
  std::array<std::vector<double>, 3> at;
  for (const auto& p : places)
    for (std::size_t axis = 0; axis < 3; ++axis) at[axis].push_back(p[axis]);
  auto assembled = assemble_cloud({{"x", at[0]}, {"y", at[1]}, {"z", at[2]}}, {});
  auto finished = finish_cloud(std::move(assembled).value(), {});
  REQUIRE(finished.ok());
  return std::move(finished).value().cloud;
}

TEST_CASE("LAS: scale and offset give positions to the bit, and the bits of a record their columns") {
  const ImportedCloud imported = read(seed("format0.las"));
  const Cloud cloud = in_caller_order(imported.cloud);
  REQUIRE(cloud.size() == 3);
  for (std::size_t i = 0; i < 3; ++i) {
    const auto k = static_cast<double>(i);
    CHECK(model_position(cloud, i) ==
          Vec3d((123.0 + k) * 0.001 + 500000.0, 776456.0 * 0.001 + 4649000.0, k * 1000.0 * 0.001));
  }
  CHECK(model_position(cloud, 0) == Vec3d(500000.123, 4649776.456, 0));
  CHECK(values<std::uint16_t>(cloud, "intensity") == std::vector<std::uint16_t>{0, 7, 14});
  CHECK(values<std::uint8_t>(cloud, "return_number") == Bytes{1, 1, 1});
  CHECK(values<std::uint8_t>(cloud, "number_of_returns") == Bytes{2, 2, 2});
  CHECK(values<std::uint8_t>(cloud, "scan_direction_flag") == Bytes{1, 1, 1});
  CHECK(values<std::uint8_t>(cloud, "edge_of_flight_line") == Bytes{1, 1, 1});
  CHECK(values<std::uint8_t>(cloud, "classification") == Bytes{2, 2, 2});
  CHECK(values<std::uint8_t>(cloud, "synthetic") == Bytes{1, 1, 1});
  CHECK(values<std::uint8_t>(cloud, "withheld").empty());
  CHECK(values<std::int8_t>(cloud, "scan_angle_rank") == std::vector<std::int8_t>{-5, -5, -5});
  CHECK(values<std::uint8_t>(cloud, "user_data") == Bytes{3, 3, 3});
  CHECK(values<std::uint16_t>(cloud, "point_source_id") == std::vector<std::uint16_t>{9, 9, 9});
  CHECK(imported.report.encoding == "1.2, point format 0");
  REQUIRE(imported.report.grid);
  CHECK(imported.report.grid->scale == Vec3d::Constant(0.001));
  CHECK(imported.report.step == Vec3d::Constant(0.001));
}

TEST_CASE("LAS: times, colours of 16 bits, longer records, extra bytes, waveforms") {
  const ImportedCloud longer = read(seed("format3_longer_records.las"));
  const Cloud three = in_caller_order(longer.cloud);
  CHECK(values<double>(three, "gps_time") == std::vector<double>{1e8, 1e8 + 1});
  REQUIRE(three.has_colors());
  CHECK(three.color[1] == Rgba{1, 2, 255, 255});
  CHECK(values<std::uint16_t>(three, "red_16").empty());
  CHECK(longer.report.skipped == std::vector<std::string>{"bytes without a type: extra_bytes"});

  const Cloud seven = in_caller_order(read(seed("format7_extra.las")).cloud);
  CHECK(seven.color[2] == Rgba{2, 0, 0, 255});
  CHECK(values<std::uint16_t>(seven, "red_16") == std::vector<std::uint16_t>{0, 256, 512});
  CHECK(values<std::uint8_t>(seven, "return_number") == Bytes{1, 1, 1});
  CHECK(values<std::uint8_t>(seven, "number_of_returns") == Bytes{3, 3, 3});
  CHECK(values<std::uint8_t>(seven, "synthetic") == Bytes{1, 1, 1});
  CHECK(values<std::uint8_t>(seven, "scanner_channel") == Bytes{1, 1, 1});
  CHECK(values<std::uint8_t>(seven, "scan_direction_flag") == Bytes{1, 1, 1});
  CHECK(values<std::uint8_t>(seven, "classification") == Bytes{65, 65, 65});
  CHECK(values<std::int16_t>(seven, "scan_angle") == std::vector<std::int16_t>{-5000, -5000, -5000});
  CHECK(values<double>(seven, "reflect") == std::vector<double>(3, -7 * 0.01 + 10));

  const ImportedCloud ten = read(seed("format10.las"));
  CHECK(values<std::uint16_t>(ten.cloud, "nir") == std::vector<std::uint16_t>{4, 4});
  CHECK(ten.report.skipped == std::vector<std::string>{"waveforms"});
  CHECK(read(seed("format1_waves4.las")).report.encoding == "1.3, point format 4");
}

TEST_CASE("LAS: what was read comes back to the bit, attributes and all") {
  for (const char* name : {"format0.las", "format3_longer_records.las", "format1_waves4.las",
                           "format7_extra.las", "format10.las"}) {
    CAPTURE(name);
    const ImportedCloud first = read(seed(name));
    const ImportedCloud again = through(first.cloud, CloudFormat::kLas, {.grid = first.report.grid});
    CHECK(difference(again.cloud, first.cloud) == "");
    CHECK(again.report.grid == first.report.grid);
  }
}

TEST_CASE("LAS: every column of every type survives, as standard dimensions or as extra bytes") {
  for (const Place place : {Place::kNearZero, Place::kFarFloat, Place::kFarDouble, Place::kNearDouble}) {
    const Cloud cloud = cloud_with_everything(60, place).cloud;
    const ImportedCloud written = through(cloud, CloudFormat::kLas);
    Cloud again = in_caller_order(written.cloud);
    const Cloud before = in_caller_order(cloud);
    for (std::size_t i = 0; i < cloud.size(); ++i) {
      const Vec3d moved = (model_position(again, i) - model_position(before, i)).cwiseAbs();
      CHECK(moved.maxCoeff() <= 0.5 * written.report.step.maxCoeff());
    }
    // Float32 at such coordinates has few decimals, which a coarser grid holds exactly.
    if (place != Place::kFarFloat) CHECK(written.report.step.maxCoeff() <= 200.0 / 2147483648.0);
    CHECK(again.normal[7] == before.normal[7]);
    CHECK(again.color == before.color);
    CHECK(again.texcoord == before.texcoord);
    REQUIRE(again.scalars.size() == before.scalars.size());
    for (const ScalarAttribute& scalar : before.scalars) {
      CAPTURE(scalar.name);
      Cloud one = again;
      Cloud other = again;
      std::erase_if(one.scalars, [&](const ScalarAttribute& s) { return s.name != scalar.name; });
      other.scalars = {scalar};
      CHECK(difference(one, other) == "");
    }
  }
}

TEST_CASE(
    "LAS: decimals at UTM coordinates get a decimal scale; an edit keeps the bits of what did not move") {
  const Cloud survey =
      cloud_at({{500000.123, 4649776.456, 12.345}, {500101.5, 4649801.001, 9.999}, {500050, 4649790, 11}});
  const ImportedCloud read_back = through(survey, CloudFormat::kLas);
  REQUIRE(read_back.report.grid);
  CHECK(read_back.report.grid->scale == Vec3d::Constant(0.001));
  const Cloud decimal = in_caller_order(read_back.cloud);
  for (std::size_t i = 0; i < 3; ++i) {
    const Vec3d off = (model_position(decimal, i) - model_position(in_caller_order(survey), i)).cwiseAbs();
    CHECK(off.maxCoeff() <= 0x1.0p-30);  // a step of float64 at 4,649,776
  }
  Cloud edited = in_caller_order(read_back.cloud);
  REQUIRE_FALSE(edited.exact_position.empty());
  edited.exact_position[1] = {500101.50037, 4649801.00123456, 9.9987654321};
  const ImportedCloud after = through(edited, CloudFormat::kLas, {.grid = read_back.report.grid});
  const Cloud kept = in_caller_order(after.cloud);
  CHECK(model_position(kept, 0) == model_position(decimal, 0));
  CHECK(model_position(kept, 2) == model_position(decimal, 2));
  const Vec3d off = (model_position(kept, 1) - model_position(edited, 1)).cwiseAbs();
  CHECK((off.array() <= 0.5 * after.report.grid->scale.array() + 0x1.0p-30).all());
  CHECK((after.report.grid->scale.array() < 0.001).all());
}

TEST_CASE("LAS: binary fractions, one sample and huge spans find a grid of their own") {
  const Cloud dyadic = cloud_at({{0.5 + 0x1.0p-20, 1, 2}, {1000.25, 2, 3}, {3, 4, 5}});
  CHECK(difference(through(dyadic, CloudFormat::kLas).cloud, dyadic) == "");
  const Cloud one = cloud_at({{500000.1234567, -4649776.4567891, 1e-7}});
  CHECK(difference(through(one, CloudFormat::kLas).cloud, one) == "");
  const Cloud wide = cloud_at({{-1e9, -1e9, 0}, {1e9, 1e9, 0.1}});
  const Cloud again = in_caller_order(through(wide, CloudFormat::kLas).cloud);
  CHECK((model_position(again, 0) - Vec3d(-1e9, -1e9, 0)).cwiseAbs().maxCoeff() <= 0.5);
}

TEST_CASE("LAS: LAZ is refused with a way out, and every wrong header with a reason") {
  const auto laz = read_cloud(seed("laz.las"), CloudFormat::kLas, {});
  REQUIRE_FALSE(laz.ok());
  CHECK(laz.error().code == ErrorCode::kUnsupportedFormat);
  CHECK(laz.error().message.find("laszip") != std::string::npos);
  const auto broken = [](std::size_t at, auto value, const char* name = "format0.las") {
    auto bytes = seed(name);
    put(bytes, at, value);
    return error_of(bytes, CloudFormat::kLas).code;
  };
  using enum ErrorCode;
  CHECK(broken(24, std::uint8_t{2}) == kUnsupportedFormat);
  CHECK(broken(25, std::uint8_t{5}) == kUnsupportedFormat);
  CHECK(broken(104, std::uint8_t{11}) == kUnsupportedFormat);
  CHECK(broken(94, std::uint16_t{100}) == kMalformedData);
  CHECK(broken(94, std::uint16_t{60000}) == kMalformedData);
  CHECK(broken(96, std::uint32_t{10}) == kMalformedData);
  CHECK(broken(96, std::uint32_t{4000000000U}) == kMalformedData);
  CHECK(broken(100, std::uint32_t{4000000000U}) == kMalformedData);
  CHECK(broken(100, std::uint32_t{9}) == kMalformedData);
  CHECK(broken(105, std::uint16_t{19}) == kMalformedData);
  CHECK(broken(107, std::uint32_t{0}) == kEmptyCloud);
  CHECK(broken(107, std::uint32_t{4}) == kMalformedData);
  CHECK(broken(107, std::uint32_t{4000000000U}) == kTooLarge);
  CHECK(broken(131, 0.0) == kMalformedData);
  CHECK(broken(139, std::numeric_limits<double>::quiet_NaN()) == kMalformedData);
  CHECK(broken(155, std::numeric_limits<double>::infinity()) == kMalformedData);
  CHECK(broken(155, 1e12) == kOutOfRange);
  auto far_records = seed("format7_extra.las");
  put(far_records, 235, std::uint64_t{1} << 63U);
  put(far_records, 243, std::uint32_t{1});
  CHECK(error_of(far_records, CloudFormat::kLas).code == kMalformedData);
}

TEST_CASE("LAS: cut anywhere or with a byte changed it is refused or read, and nothing else") {
  for (const char* name : {"format7_extra.las", "format3_longer_records.las"}) {
    const auto whole = seed(name);
    for (std::size_t length = 0; length < whole.size(); ++length)
      CHECK_FALSE(read_cloud(std::span(whole).first(length), CloudFormat::kLas, {}).ok());
    Random random(11);
    for (int i = 0; i < 3000; ++i) {
      auto mutant = whole;
      for (int k = 0; k < 3; ++k)
        mutant[random.below(mutant.size())] = static_cast<std::byte>(random.next() & 0xFFU);
      const auto result =
          read_cloud(mutant, CloudFormat::kLas, {.max_samples = 1000, .drop_non_finite = true});
      if (result.ok()) CHECK(validate(result.value().cloud).ok());
    }
  }
}

TEST_CASE("LAS: names that do not fit are cut apart, and too many columns are refused") {
  Cloud cloud = cloud_at({{1, 2, 3}, {4, 5, 6}});
  const std::string name = "a_name_that_is_longer_than_the_32_bytes";
  cloud.scalars = {{name + "_1", std::vector<float>{1, 2}}, {name + "_2", std::vector<float>{3, 4}}};
  const Cloud again = through(cloud, CloudFormat::kLas).cloud;
  REQUIRE(again.scalars.size() == 2);
  CHECK(again.scalars[0].name == name.substr(0, 32));
  CHECK(again.scalars[1].name == name.substr(0, 30) + "_2");
  for (int i = 0; i < 341; ++i) cloud.scalars.push_back({std::to_string(i), std::vector<std::uint8_t>{1, 2}});
  CHECK(write_cloud(cloud, CloudFormat::kLas, {}).error().code == ErrorCode::kUnsupportedFormat);
}

}  // namespace
}  // namespace pointwright::io_test

#include "tests/io/io_support.h"

#include <doctest/doctest.h>

#include <cmath>
#include <cstring>
#include <fstream>
#include <limits>

#include "engine/io/columns.h"
#include "engine/io/decoded_cloud.h"

namespace pointwright::io_test {
namespace {

template <typename T>
bool same_bits(const std::vector<T>& a, const std::vector<T>& b) {
  return a.size() == b.size() && (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0);
}

bool same_bits(const Points& a, const Points& b) {
  if (a.size() != b.size()) return false;
  const std::size_t bytes = a.size() * sizeof(float);
  return a.empty() || (std::memcmp(a.x(), b.x(), bytes) == 0 && std::memcmp(a.y(), b.y(), bytes) == 0 &&
                       std::memcmp(a.z(), b.z(), bytes) == 0);
}

template <typename T>
ScalarAttribute extreme_column(const std::string& name, std::size_t count, Random& random) {
  std::vector<T> values(count);
  for (T& value : values) {
    if constexpr (std::is_floating_point_v<T>) {
      value = static_cast<T>(random.uniform(-1e5, 1e5));
    } else {
      value = static_cast<T>(random.next());
    }
  }
  values[0] = std::numeric_limits<T>::lowest();
  if (count > 1) values[1] = std::numeric_limits<T>::max();
  if constexpr (std::is_floating_point_v<T>) {
    if (count > 2) values[2] = std::numeric_limits<T>::quiet_NaN();
    if (count > 3) values[3] = -T{0};
    if (count > 4) values[4] = std::numeric_limits<T>::denorm_min();
  }
  return {name, values};
}

struct Columns {
  std::vector<ScalarAttribute> list;

  template <typename T, typename Make>
  void add(const char* name, std::size_t count, const Make& make) {
    std::vector<T> values(count);
    for (T& value : values) value = static_cast<T>(make());
    list.push_back({name, std::move(values)});
  }
};

void add_positions(Columns& columns, std::size_t count, Place place, Random& random) {
  const bool far = place == Place::kFarFloat || place == Place::kFarDouble;
  const std::array<double, 3> origin =
      far ? std::array{665187.25, 5648349.5, 241.0} : std::array{0.0, 0.0, 0.0};
  constexpr std::array<const char*, 3> kNames{"x", "y", "z"};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto make = [&] { return origin[axis] + random.uniform(-100.0, 100.0); };
    if (place == Place::kFarDouble || place == Place::kNearDouble) {
      columns.add<double>(kNames[axis], count, make);
    } else {
      columns.add<float>(kNames[axis], count, make);
    }
  }
}

}  // namespace

std::vector<std::byte> bytes_of(std::string_view text) {
  const auto* begin = reinterpret_cast<const std::byte*>(text.data());
  return {begin, begin + text.size()};
}

std::string text_of(std::span<const std::byte> bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

std::uint64_t Random::next() {
  state_ += 0x9e3779b97f4a7c15ULL;
  std::uint64_t z = state_;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ULL;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebULL;
  return z ^ (z >> 31);
}

double Random::uniform(double low, double high) {
  return low + (high - low) * static_cast<double>(next() >> 11) * 0x1.0p-53;
}

ImportedCloud cloud_with_everything(std::size_t count, Place place, std::uint64_t seed) {
  Random random(seed);
  Columns columns;
  add_positions(columns, count, place, random);
  std::array<std::vector<float>, 3> normal;
  for (std::size_t i = 0; i < count; ++i) {
    Vec3d n(random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1));
    n = (n + Vec3d(0, 0, 3)).normalized();
    for (std::size_t axis = 0; axis < 3; ++axis) {
      normal[axis].push_back(static_cast<float>(n[static_cast<Eigen::Index>(axis)]));
    }
  }
  columns.list.push_back({"nx", normal[0]});
  columns.list.push_back({"ny", normal[1]});
  columns.list.push_back({"nz", normal[2]});
  for (const char* name : {"red", "green", "blue", "alpha"}) {
    columns.add<std::uint8_t>(name, count, [&] { return random.next(); });
  }
  for (const char* name : {"s", "t"}) columns.add<float>(name, count, [&] { return random.uniform(-2, 3); });
  columns.list.push_back(extreme_column<std::int8_t>("tiny", count, random));
  columns.list.push_back(extreme_column<std::uint8_t>("classification", count, random));
  columns.list.push_back(extreme_column<std::int16_t>("angle", count, random));
  columns.list.push_back(extreme_column<std::uint16_t>("intensity", count, random));
  columns.list.push_back(extreme_column<std::int32_t>("label", count, random));
  columns.list.push_back(extreme_column<std::uint32_t>("source", count, random));
  columns.list.push_back(extreme_column<float>("quality", count, random));
  columns.list.push_back(extreme_column<double>("gps_time", count, random));
  auto assembled = assemble_cloud(std::move(columns.list), {});
  REQUIRE(assembled.ok());
  auto finished = finish_cloud(std::move(assembled).value(), {});
  REQUIRE(finished.ok());
  return std::move(finished).value();
}

ImportedCloud sphere(std::size_t count, std::uint64_t seed) {
  Random random(seed);
  std::array<std::vector<float>, 3> at;
  for (std::size_t i = 0; i < count; ++i) {
    const double z = random.uniform(-1, 1);
    const double angle = random.uniform(0, 6.283185307179586);
    const double r = std::sqrt(1 - z * z);
    at[0].push_back(static_cast<float>(r * std::cos(angle)));
    at[1].push_back(static_cast<float>(r * std::sin(angle)));
    at[2].push_back(static_cast<float>(z));
  }
  auto assembled = assemble_cloud({{"x", at[0]}, {"y", at[1]}, {"z", at[2]}}, {});
  auto finished = finish_cloud(std::move(assembled).value(), {});
  REQUIRE(finished.ok());
  return std::move(finished).value();
}

std::string difference(const Cloud& a, const Cloud& b) {
  if (std::memcmp(a.origin.data(), b.origin.data(), 3 * sizeof(double)) != 0) return "origin";
  if (!same_bits(a.position, b.position)) return "position";
  if (!same_bits(a.normal, b.normal)) return "normal";
  if (!same_bits(a.color, b.color) || a.color_has_alpha != b.color_has_alpha) return "color";
  if (!same_bits(a.texcoord, b.texcoord)) return "texcoord";
  if (!same_bits(a.id, b.id)) return "id";
  if (!same_bits(a.exact_position, b.exact_position)) return "exact_position";
  if (a.position_is_double != b.position_is_double) return "position_is_double";
  if (a.scalars.size() != b.scalars.size()) return "number of scalars";
  for (std::size_t s = 0; s < a.scalars.size(); ++s) {
    if (a.scalars[s].name != b.scalars[s].name) return "name " + a.scalars[s].name + " " + b.scalars[s].name;
    if (a.scalars[s].values.index() != b.scalars[s].values.index()) return "type of " + a.scalars[s].name;
    const bool same = std::visit(
        [&](const auto& values) {
          return same_bits(values, std::get<std::decay_t<decltype(values)>>(b.scalars[s].values));
        },
        a.scalars[s].values);
    if (!same) return "values of " + a.scalars[s].name;
  }
  return {};
}

ImportedCloud through(const Cloud& cloud, CloudFormat format, const ExportParams& params) {
  auto written = write_cloud(cloud, format, params);
  INFO(std::string(format_name(format)), ": ", why(written));
  REQUIRE(written.ok());
  auto read = read_cloud(written.value(), format, {});
  INFO(why(read));
  REQUIRE(read.ok());
  return std::move(read).value();
}

Error error_of(std::span<const std::byte> bytes, CloudFormat format, const ImportParams& params) {
  const auto read = read_cloud(bytes, format, params);
  INFO(text_of(bytes.first(std::min<std::size_t>(bytes.size(), 300))));
  REQUIRE_FALSE(read.ok());
  CHECK_FALSE(read.error().message.empty());
  return read.error();
}

Error error_of(std::string_view text, CloudFormat format, const ImportParams& params) {
  return error_of(bytes_of(text), format, params);
}

ImportedCloud read_text(std::string_view text, CloudFormat format, const ImportParams& params) {
  auto read = read_cloud(bytes_of(text), format, params);
  INFO(std::string(text.substr(0, 300)));
  INFO(why(read));
  REQUIRE(read.ok());
  return std::move(read).value();
}

std::uint64_t peak_memory() {
  std::ifstream status("/proc/self/status");
  std::string word;
  std::uint64_t kilobytes = 0;
  while (status >> word) {
    if (word == "VmHWM:") status >> kilobytes;
  }
  return kilobytes * 1024;
}

void reset_peak_memory() {
  std::ofstream("/proc/self/clear_refs") << "5";
}

}  // namespace pointwright::io_test

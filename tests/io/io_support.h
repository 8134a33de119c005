#pragma once
// Clouds and bytes that several tests of reading and writing need.

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "engine/io/cloud_io.h"

namespace pointwright::io_test {

std::vector<std::byte> bytes_of(std::string_view text);
std::string text_of(std::span<const std::byte> bytes);

/// A small generator whose numbers are the same everywhere.
class Random {
 public:
  explicit Random(std::uint64_t seed) : state_(seed) {}
  std::uint64_t next();
  double uniform(double low, double high);
  std::uint64_t below(std::uint64_t bound) { return next() % bound; }

 private:
  std::uint64_t state_;
};

/// Where a made cloud stands and in which precision.
enum class Place { kNearZero, kFarFloat, kFarDouble, kNearDouble };

/// A finished cloud with every kind of column: normals, colours with alpha, texture coordinates and a scalar
/// of each type with its extreme values (NaN among the floats). Made by the library's own finishing.
ImportedCloud cloud_with_everything(std::size_t count, Place place, std::uint64_t seed = 1);

/// Positions alone, on a unit sphere.
ImportedCloud sphere(std::size_t count, std::uint64_t seed = 1);

/// Why something failed; empty where it did not.
template <typename T>
std::string why(const Result<T>& result) {
  return result.ok() ? std::string() : result.error().message;
}

/// Why two clouds differ, to the bit (-0 is not 0, a NaN equals itself); empty where they do not.
std::string difference(const Cloud& a, const Cloud& b);

/// write_cloud, then read_cloud; fails the test where either does.
ImportedCloud through(const Cloud& cloud, CloudFormat format, const ExportParams& params = {});

/// The error of reading these bytes; fails the test where they can be read.
Error error_of(std::span<const std::byte> bytes, CloudFormat format, const ImportParams& params = {});
Error error_of(std::string_view text, CloudFormat format, const ImportParams& params = {});

/// Reads text; fails the test where it cannot be read.
ImportedCloud read_text(std::string_view text, CloudFormat format, const ImportParams& params = {});

/// This process's peak resident memory since reset_peak_memory(), in bytes.
std::uint64_t peak_memory();
void reset_peak_memory();

}  // namespace pointwright::io_test

#include <algorithm>
#include <stdexcept>
#include <string>

#include "engine/io/cloud_blob.h"
#include "engine/io/cloud_io.h"
#include "engine/io/decoded_cloud.h"
#include "engine/io/draco_gate.h"
#include "engine/io/draco_tiles.h"
#include "tests/fuzz/targets.h"

namespace pointwright::fuzz {
namespace {

constexpr ImportParams kParams{.max_samples = 100'000, .drop_non_finite = true};

void promise(bool kept, const char* what) {
  if (!kept) throw std::logic_error(std::string("broken promise: ") + what);
}

// What holds of every cloud that was taken.
void check_taken(const ImportedCloud& imported) {
  const Cloud& cloud = imported.cloud;
  promise(validate(cloud).ok(), "a cloud that was taken is valid");
  promise(cloud.size() == imported.report.sample_count && cloud.size() > 0, "the report counts the samples");
  promise(imported.report.bounds_min.allFinite() && imported.report.bounds_max.allFinite(),
          "bounds are finite");
  promise(imported.report.bounds_max.cwiseAbs().maxCoeff() <= 1e9, "coordinates are in range");
}

void try_format(std::span<const std::byte> bytes, CloudFormat format) {
  const auto read = read_cloud(bytes, format, kParams);
  if (!read.ok()) {
    promise(!read.error().message.empty(), "an error says something");
    return;
  }
  check_taken(read.value());
  const auto written = write_cloud(read.value().cloud, CloudFormat::kPly, {});
  promise(written.ok(), "what was read can be written");
  const auto again = read_cloud(written.value(), CloudFormat::kPly, kParams);
  promise(again.ok(), "what was written can be read");
  // An origin that the file names need not be the one that its samples would get: orders may differ.
  const Cloud before = in_caller_order(read.value().cloud);
  const Cloud after = in_caller_order(again.value().cloud);
  promise(after.size() == before.size(), "the samples survive");
  const ImportReport& report = read.value().report;
  const double tolerance = 1e-6 * (report.bounds_max - report.bounds_min).norm() +
                           1e-15 * report.bounds_max.cwiseAbs().cwiseMax(report.bounds_min.cwiseAbs()).norm();
  for (std::size_t i = 0; i < before.size(); ++i)
    promise((model_position(after, i) - model_position(before, i)).norm() <= tolerance,
            "every sample stays where it was, in its place");
}

}  // namespace

void try_draco(std::span<const std::byte> bytes) {
  // The decoder's appetite is bounded by its process's limits in the daemon; here by what the gate lets
  // through.
  const auto claim = draco_gate(bytes, kParams.max_samples);
  if (!claim.ok() || claim.value().faces > 100'000) return;
  try_format(bytes, CloudFormat::kDraco);
}

void try_draco_tiles(std::span<const std::byte> bytes) {
  static_cast<void>(detect_format(bytes));
  static_cast<void>(parse_draco_tiles_index({reinterpret_cast<const char*>(bytes.data()), bytes.size()},
                                            kParams.max_samples));
  auto reader = DracoTilesReader::open(bytes, kParams.max_samples);
  if (!reader.ok()) return;
  while (true) {
    const auto piece = reader.value().next();
    if (!piece.ok() || !piece.value()) break;
    const auto claim = draco_gate(piece.value()->bytes, kParams.max_samples);
    if (claim.ok() && claim.value().faces > 100'000) return;
  }
  try_format(bytes, CloudFormat::kDracoTiles);
}

void try_ply(std::span<const std::byte> bytes) {
  try_format(bytes, CloudFormat::kPly);
}

void try_xyz(std::span<const std::byte> bytes) {
  static_cast<void>(detect_format(bytes));
  try_format(bytes, CloudFormat::kXyz);
}

void try_obj(std::span<const std::byte> bytes) {
  try_format(bytes, CloudFormat::kObj);
}

void try_pcd(std::span<const std::byte> bytes) {
  try_format(bytes, CloudFormat::kPcd);
}

void try_las(std::span<const std::byte> bytes) {
  try_format(bytes, CloudFormat::kLas);
  const auto read = read_cloud(bytes, CloudFormat::kLas, kParams);
  if (!read.ok()) return;
  const auto written = write_cloud(read.value().cloud, CloudFormat::kLas, {.grid = read.value().report.grid});
  if (!written.ok()) return;
  const auto again = read_cloud(written.value(), CloudFormat::kLas, kParams);
  promise(again.ok() || again.error().code == ErrorCode::kOutOfRange, "what was written as LAS can be read");
  promise(!again.ok() || again.value().cloud.size() == read.value().cloud.size(), "no sample is lost");
}

void try_cloud_blob(std::span<const std::byte> bytes) {
  auto blob = read_cloud_blob(bytes);
  if (!blob.ok()) return;
  const auto again = cloud_blob(blob.value());
  promise(std::equal(again.begin(), again.end(), bytes.begin(), bytes.end()), "a blob comes back as it was");
  const auto finished = finish_cloud(std::move(blob).value(), kParams);
  if (finished.ok()) check_taken(finished.value());
}

}  // namespace pointwright::fuzz

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <memory>
#include <system_error>
#include <utility>

#include "server/jobs/full_resolution.h"
#include "server/jobs/packed_result.h"
#include "server/jobs/recipe_script.h"
#include "server/jobs/scan_source.h"
#include "server/jobs/tile_store.h"

namespace pointwright::server {
namespace {

/// Of the modes memory and direct, beside the cloud's own columns: neighbours, levels, bases, results. With
/// the columns' 20 bytes that is 10 % more than peak_memory_bytes of `pointwright job run --json` with two
/// edits on 2.6 million samples in either mode; a process with few samples takes tens of mebibytes besides.
constexpr std::uint64_t kWorkingBytes = 400;
/// Without a preview nothing can be timed: the same job took 2.2e-6 in tiles, 2.5e-6 in memory and 3.5e-6 in
/// the mode direct on two cores, reading and writing included.
constexpr double kUsualSecondsPerSample = 2e-6;
/// Reading, cutting and writing come on top of the edits.
constexpr double kSecondsPerByte = 4e-9;

/// What a recipe does to each sample.
struct Rate {
  double seconds = kUsualSecondsPerSample;
  double inserted = 0.0;
};
/// Timed on the preview itself; inserted samples count in the time of those that they come from.
Outcome<Rate> rate_of(const JobParams& params, const ExecutionContext& context) {
  if (params.preview == nullptr) return Rate();
  const auto levels = hierarchy_for(params.request.recipe, *params.preview, params.neighbors);
  if (!levels.ok()) return levels.problem();
  const auto played = play_on_preview(params.request, params.preview, levels.value(), context);
  if (!played.ok()) return played.problem();
  const auto begin = std::chrono::steady_clock::now();
  const AnchorIndex anchors(played.value().script.rest);
  const auto made = transfer_edits(played.value().script, anchors, params.preview, context);
  if (!made) return protocol::to_problem(made.error());
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
  const auto each = static_cast<double>(params.preview->size());
  return Rate{.seconds = took.count() / each,
              .inserted = static_cast<double>(played.value().inserted) / each};
}

/// Where the folder will be: the nearest one above it that is there.
std::filesystem::path place_of(const std::string& path) {
  std::error_code none;
  std::filesystem::path place = std::filesystem::absolute(path, none);
  while (place.has_relative_path() && !std::filesystem::exists(place, none)) place = place.parent_path();
  return place;
}

}  // namespace

Outcome<JobEstimate> estimate_full_resolution(const JobParams& params, const ExecutionContext& context) {
  const auto chosen = choose_mode(params);
  if (!chosen.ok()) return chosen.problem();
  JobEstimate estimate{.mode = chosen.value().mode};
  std::error_code none;
  const std::uint64_t bytes = std::filesystem::file_size(params.input, none);
  const std::uint64_t clouds = params.steps.value_or(1);
  const auto rate = rate_of(params, context);
  if (!rate.ok()) return rate.problem();
  const auto grown = [&](std::uint64_t amount) {
    return static_cast<std::uint64_t>((1.0 + rate.value().inserted) * static_cast<double>(amount));
  };
  if (chosen.value().mode == JobMode::kTiles) {
    const std::optional<PackedScan>& packed = chosen.value().packed;
    estimate.samples = packed ? packed->samples : chosen.value().records->count;
    estimate.memory_bytes = params.memory_bytes;
    // Draco tiles without loss are about as long as their records.
    const std::uint64_t unpacked =
        packed ? (packed->record_bytes ? *packed->record_bytes * packed->samples : bytes) : 0;
    const std::uint64_t scan = packed ? unpacked : bytes;
    // The records of inserted samples stand in their tiles' files first.
    estimate.disk_bytes =
        unpacked + (1 + clouds) * sizeof(TileSample) * estimate.samples + clouds * (2 * grown(scan) - scan);
    if (chosen.value().packs)
      estimate.disk_bytes += packing_bytes(grown(estimate.samples), 0) + (clouds + 2) * grown(scan);
  } else {
    const auto scan = read_scan(params);
    if (!scan) return protocol::to_problem(scan.error());
    estimate.samples = scan.value().cloud.size();
    const std::uint64_t columns = memory_of(scan.value().cloud);
    estimate.memory_bytes = grown(columns + estimate.samples * kWorkingBytes);
    estimate.disk_bytes = clouds * grown(columns);
  }
  estimate.seconds =
      static_cast<double>(clouds) * (rate.value().seconds * static_cast<double>(estimate.samples) +
                                     kSecondsPerByte * static_cast<double>(bytes));
  const auto space = std::filesystem::space(place_of(params.folder), none);
  if (!none) estimate.free_disk_bytes = space.available;
  return estimate;
}

}  // namespace pointwright::server

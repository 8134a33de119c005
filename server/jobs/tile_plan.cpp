#include "server/jobs/tile_plan.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include "engine/resampling/splitting.h"

namespace pointwright::server {
namespace {

using protocol::Problem;
using protocol::ProblemKind;

/// What a tile's samples and those around them take while they are edited, for each band and for all; and
/// with resampling, which copies them.
constexpr std::uint64_t kBytesOfSample = 360;
constexpr std::uint64_t kBytesOfBand = 90;
constexpr std::uint64_t kBytesOfResampling = 400;
/// Of the memory, what preview, buffers and the program itself may take.
constexpr double kShareOfTiles = 0.8;
constexpr std::size_t kLanes = 2;
/// Samples around a tile, by its own: a guess that the share above leaves room for.
constexpr double kAround = 1.5;
constexpr double kLeastSamples = 4096.0;
/// What is read is at most so many times as wide as the tile: else tiles are made one after another.
constexpr double kWidest = 8.0;
/// Less than that nobody gives to a program of this size; tests ask for tiny tiles.
constexpr std::uint64_t kLeastMemory = std::uint64_t{128} << 20U;
/// TileStore::load takes rings this much wider than even scans have them.
constexpr double kRingRoom = 1.25;

/// Of one edit's resampling: its patches and their neighbours; two for each sweep, whose families stand in
/// rings of 16; rows that are updated; and of its collection, by round. Ten rounds end a squeeze by a
/// thousand, and no pair is farther apart than one spacing.
std::uint32_t rings_of(const ResamplingParams& params) {
  constexpr std::uint32_t kOfPatches = 6;
  constexpr std::uint32_t kOfSweep = 2;
  constexpr std::uint32_t kOfCollection = 14;
  return kOfPatches + kOfSweep * params.sweeps + (params.collect > 0.0 ? kOfCollection : 0);
}

}  // namespace

bool resamples(const PlayedSteps& played) {
  return std::ranges::any_of(played.steps, [](const PlayedSteps::Step& step) {
    return std::ranges::any_of(
        step.edits, [](const TransferredEdit& edit) { return edit.params.resampling.has_value(); });
  });
}

std::uint32_t rings_of(const PlayedSteps& played) {
  const auto bands = static_cast<std::uint32_t>(played.script.bases.bands.size());
  std::uint32_t most = 1;
  for (const PlayedSteps::Step& step : played.steps) {
    std::uint32_t rings = 1;
    for (const TransferredEdit& edit : step.edits) {
      rings += bands - edit.params.level + 1;
      if (edit.params.resampling) rings += rings_of(*edit.params.resampling);
    }
    most = std::max(most, rings);
  }
  return most;
}

Outcome<TilePlan> plan_tiles(const PlayedSteps& played, std::uint64_t samples, std::uint32_t neighbors,
                             std::uint64_t memory_bytes) {
  const std::uint64_t bytes_each = kBytesOfSample + kBytesOfBand * played.script.bases.bands.size() +
                                   (resamples(played) ? kBytesOfResampling : 0);
  const auto samples_in = [&](std::uint64_t bytes, std::size_t lanes) {
    return kShareOfTiles * static_cast<double>(bytes) / static_cast<double>(lanes * bytes_each);
  };
  // In spacings: k samples fill a disc of radius sqrt(k / pi).
  const double ring = kRingRoom * std::sqrt((static_cast<double>(neighbors) + 0.5) / std::numbers::pi);
  const double around = 2.0 * ring * static_cast<double>(rings_of(played));
  for (const std::size_t lanes : {kLanes, std::size_t{1}}) {
    const double room = samples_in(memory_bytes, lanes);
    const double side = std::min(std::sqrt(room / kAround), std::sqrt(room) - around);
    if (side * kWidest >= std::sqrt(room))
      return TilePlan{.most = static_cast<std::uint64_t>(std::max(kLeastSamples, side * side)),
                      .lanes = lanes};
  }
  const double least =
      std::min(static_cast<double>(samples), std::pow(std::sqrt(kLeastSamples) + around, 2.0));
  if (least <= samples_in(std::max(memory_bytes, kLeastMemory), 1))
    return TilePlan{.most = static_cast<std::uint64_t>(kLeastSamples), .lanes = 1};
  const double needed = least * static_cast<double>(bytes_each) / kShareOfTiles;
  return Problem{.kind = ProblemKind::kOutOfSpace,
                 .detail = "what a tile's samples depend on around it, by all edits of this recipe, takes " +
                           std::to_string(static_cast<std::uint64_t>(needed) >> 20U) +
                           " MiB of memory: give the job more, or make the recipe in parts",
                 .limit = static_cast<double>(memory_bytes),
                 .actual = std::ceil(needed)};
}

Points weighted_candidates(const Cloud& candidates, const PlayedSteps& played,
                           const ExecutionContext& context) {
  // Candidates may stand about another origin than the preview that was given.
  Points position(candidates.size());
  const Vec3d offset = candidates.origin - played.script.origin;
  for (std::size_t i = 0; i < position.size(); ++i)
    position.set(i, (candidates.position[i].cast<double>() + offset).cast<float>());
  if (!resamples(played)) return position;
  std::vector<std::uint32_t> families(played.rest.size(), 1);
  for (const PlayedSteps::Step& step : played.steps)
    for (std::size_t a = 0; a < step.families.size(); ++a)
      families[a] = std::clamp(step.families[a], families[a], kMostParts);
  const std::vector<std::uint32_t> anchors =
      AnchorIndex(played.script.rest).anchors_of(position, Points(), context);
  std::size_t count = 0;
  for (const std::uint32_t anchor : anchors) count += families[anchor];
  Points weighted(count);
  std::size_t at = 0;
  for (std::size_t i = 0; i < position.size(); ++i)
    for (std::uint32_t k = 0; k < families[anchors[i]]; ++k) weighted.set(at++, position[i]);
  return weighted;
}

}  // namespace pointwright::server

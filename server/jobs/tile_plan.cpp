#include "server/jobs/tile_plan.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <utility>

#include "engine/resampling/splitting.h"
#include "engine/spatial/kd_tree.h"

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
/// No job is refused for what the preview and the program take anyway.
constexpr std::uint64_t kLeastMemory = std::uint64_t{256} << 20U;
/// TileStore::load takes rings this much wider than even scans have them.
constexpr double kRingRoom = 1.25;

/// Of one edit's resampling: its patches and rows that are updated, and their neighbours; one for each sweep,
/// whose families stand in rings of 16 (2.3 spacings of an even scan, as wide as a ring here); and of its
/// collection: ten rounds end a squeeze by a thousand, and who is each other's nearest shows within twice the
/// distance that is collected.
std::uint32_t rings_of(const ResamplingParams& params) {
  constexpr std::uint32_t kOfPatches = 6;
  constexpr std::uint32_t kOfCollection = 8;
  return kOfPatches + params.sweeps + (params.collect > 0.0 ? kOfCollection : 0);
}

/// Of the preview's samples, the greatest of all steps.
std::vector<std::uint32_t> greatest_families(const PlayedSteps& played) {
  std::vector<std::uint32_t> families(played.rest.size(), 1);
  for (const PlayedSteps::Step& step : played.steps)
    for (std::size_t a = 0; a < step.families.size(); ++a)
      families[a] = std::clamp(step.families[a], families[a], kMostParts);
  return families;
}

/// What all but a twentieth of those that become several become at most.
double usual_family(const PlayedSteps& played) {
  std::vector<std::uint32_t> families = greatest_families(played);
  std::erase(families, 1U);
  if (families.empty()) return 1.0;
  const auto place = families.begin() + static_cast<std::ptrdiff_t>(families.size() * 19 / 20);
  std::nth_element(families.begin(), place, families.end());
  return *place;
}

/// Samples that the smallest tile comes to, with all that is read around it, where those stand that become
/// most: the most of discs about up to 256 of the preview's samples that become at least half as many as any.
double most_of_one_tile(const PlayedSteps& played, std::uint64_t samples, double around) {
  constexpr std::size_t kDiscs = 256;
  constexpr double kMembers = 512.0;  // of a disc: enough to tell how much its samples become
  const double read =
      std::min(static_cast<double>(samples), std::pow(std::sqrt(kLeastSamples) + around, 2.0));
  const std::vector<std::uint32_t> families = greatest_families(played);
  const std::uint32_t greatest = *std::ranges::max_element(families);
  if (greatest == 1) return read;
  // The preview is thinned where a disc would hold more of it than that.
  const double each = std::max(1.0, static_cast<double>(samples) / static_cast<double>(families.size()));
  const auto stride = static_cast<std::size_t>(std::max(1.0, std::ceil(read / (each * kMembers))));
  const double for_each = each * static_cast<double>(stride);
  std::vector<std::uint32_t> kept;
  std::vector<std::uint32_t> strong;
  for (std::uint32_t a = 0; a < families.size(); ++a) {
    if (a % stride == 0) kept.push_back(a);
    if (2 * families[a] >= greatest) strong.push_back(a);
  }
  const KdTree tree(played.rest, std::move(kept));
  const auto members = static_cast<std::size_t>(std::ceil(read / for_each));
  const std::size_t step = (strong.size() + kDiscs - 1) / kDiscs;
  std::vector<Neighbor> disc;
  double most = 0.0;
  for (std::size_t i = 0; i < strong.size(); i += step) {
    tree.nearest(played.rest[strong[i]], members, disc);
    double left = read;
    double become = 0.0;
    for (const Neighbor& member : disc) {
      const double taken = std::min(left, for_each);
      become += taken * families[member.index];
      left -= taken;
    }
    most = std::max(most, become + left);
  }
  return most;
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

double TilePlan::weight_of(double family) const {
  // (sqrt(own) + around)^2 samples are read, and each becomes `family`.
  const double side = std::sqrt(room / std::max(1.0, family)) - around;
  const double own = std::max(kLeastSamples, side > 0.0 ? side * side : 0.0);
  return std::max(1.0, static_cast<double>(most) / own);
}

Outcome<TilePlan> plan_tiles(const PlayedSteps& played, std::uint64_t samples, std::uint32_t neighbors,
                             std::uint64_t value_bytes, std::uint64_t memory_bytes) {
  const std::uint64_t bytes_each = kBytesOfSample + kBytesOfBand * played.script.bases.bands.size() +
                                   (resamples(played) ? kBytesOfResampling + value_bytes : 0);
  const auto samples_in = [&](std::uint64_t bytes, std::size_t lanes) {
    return kShareOfTiles * static_cast<double>(bytes) / static_cast<double>(lanes * bytes_each);
  };
  // In spacings: k samples fill a disc of radius sqrt(k / pi).
  const double ring = kRingRoom * std::sqrt((static_cast<double>(neighbors) + 0.5) / std::numbers::pi);
  const double around = 2.0 * ring * static_cast<double>(rings_of(played));
  const double family = usual_family(played);
  const double least = most_of_one_tile(played, samples, around);
  for (const std::size_t lanes : {kLanes, std::size_t{1}}) {
    const double room = samples_in(memory_bytes, lanes);
    const double widest = std::sqrt(room / family);  // that is read
    if ((widest - around) * kWidest < widest) continue;
    if (least > room) continue;
    const double side = std::min(std::sqrt(room / kAround), std::sqrt(room) - around);
    return TilePlan{.most = static_cast<std::uint64_t>(std::max(kLeastSamples, side * side)),
                    .lanes = lanes,
                    .room = room,
                    .around = around};
  }
  if (least <= samples_in(std::max(memory_bytes, kLeastMemory), 1))
    return TilePlan{.most = static_cast<std::uint64_t>(kLeastSamples),
                    .lanes = 1,
                    .room = samples_in(memory_bytes, 1),
                    .around = around};
  const double needed = least * static_cast<double>(bytes_each) / kShareOfTiles;
  return Problem{
      .kind = ProblemKind::kOutOfSpace,
      .detail =
          "the smallest tile, with what its samples depend on around it and what they become by this "
          "recipe, takes " +
          std::to_string(static_cast<std::uint64_t>(needed) >> 20U) +
          " MiB of memory: give the job more, or make the recipe in parts",
      .limit = static_cast<double>(memory_bytes),
      .actual = std::ceil(needed)};
}

Points weighted_candidates(const Cloud& candidates, const PlayedSteps& played, const TilePlan& plan,
                           const ExecutionContext& context) {
  // Candidates may stand about another origin than the preview that was given.
  Points position(candidates.size());
  const Vec3d offset = candidates.origin - played.script.origin;
  for (std::size_t i = 0; i < position.size(); ++i)
    position.set(i, (candidates.position[i].cast<double>() + offset).cast<float>());
  if (!resamples(played)) return position;
  const std::vector<std::uint32_t> families = greatest_families(played);
  const std::vector<std::uint32_t> anchors =
      AnchorIndex(played.script.rest).anchors_of(position, Points(), context);
  // Whole copies: what is left over goes to the next one.
  std::vector<std::uint32_t> copies(position.size());
  double owed = 0.0;
  std::size_t count = 0;
  for (std::size_t i = 0; i < copies.size(); ++i) {
    owed += plan.weight_of(families[anchors[i]]);
    copies[i] = static_cast<std::uint32_t>(owed);
    owed -= copies[i];
    count += copies[i];
  }
  Points weighted(count);
  std::size_t at = 0;
  for (std::size_t i = 0; i < position.size(); ++i)
    for (std::uint32_t k = 0; k < copies[i]; ++k) weighted.set(at++, position[i]);
  return weighted;
}

}  // namespace pointwright::server

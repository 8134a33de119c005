#include "server/sessions/sample_set.h"

#include <algorithm>
#include <utility>

#include "engine/resampling/cells.h"
#include "engine/spatial/splat_radius.h"
#include "protocol/frames/frame.h"

namespace pointwright::server {
namespace {

/// Places of samples by id; kNoSource for ids that none has.
std::vector<std::uint32_t> places_of(const Sampling& sampling) {
  const std::vector<std::uint32_t>& id = sampling.cloud->id;
  std::vector<std::uint32_t> places(sampling.next_id, kNoSource);
  for (std::size_t i = 0; i < id.size(); ++i) places[id[i]] = static_cast<std::uint32_t>(i);
  return places;
}

std::uint32_t at(const std::vector<std::uint32_t>& places, std::uint32_t id) {
  return id < places.size() ? places[id] : kNoSource;
}

/// The least power of two that no stretch exceeds: it seldom changes while a drag goes on.
float range_of(const std::vector<float>& stretch) {
  if (stretch.empty()) return 0.0F;
  const float most = std::max(1.0F, *std::max_element(stretch.begin(), stretch.end()));
  float range = 1.0F;
  while (range < most && range < 0x1p100F) range *= 2.0F;
  return range;
}

}  // namespace

SharedSamples samples_at_rest(Sampling sampling, const Level& rest) {
  auto radius = std::make_shared<std::vector<std::uint16_t>>();
  radius->reserve(sampling.size());
  for (const float value : splat_radii(rest.position, rest.normal, *sampling.graph))
    radius->push_back(protocol::to_bfloat16(value));
  return std::make_shared<const SampleSet>(SampleSet{
      .sampling = std::make_shared<const Sampling>(std::move(sampling)), .splat_radius = std::move(radius)});
}

SharedSamples samples_after(const SampleSet& before, std::shared_ptr<const Sampling> after) {
  SampleSet samples{.sampling = std::move(after), .splat_radius = before.splat_radius};
  if (!are_same(before, samples))
    samples.splat_radius = std::make_shared<const std::vector<std::uint16_t>>(
        carried(*before.splat_radius, sources_of(*before.sampling, *samples.sampling), std::uint16_t{0}));
  if (!samples.sampling->cell_u.empty()) samples.stretch = stretch_columns(*samples.sampling).major;
  samples.stretch_range = range_of(samples.stretch);
  return std::make_shared<const SampleSet>(std::move(samples));
}

bool are_same(const SampleSet& a, const SampleSet& b) {
  return a.sampling->cloud == b.sampling->cloud;
}

bool continues(const SampleSet& before, const SampleSet& after) {
  if (before.sampling->cloud == after.sampling->cloud) return true;
  const std::vector<std::uint32_t>& first = before.cloud().id;
  const std::vector<std::uint32_t>& all = after.cloud().id;
  return first.size() <= all.size() && std::equal(first.begin(), first.end(), all.begin());
}

std::vector<std::uint32_t> sources_of(const Sampling& from, const Sampling& to, std::uint32_t shared_ids) {
  const std::vector<std::uint32_t> places = places_of(from);
  const std::vector<std::uint32_t>& id = to.cloud->id;
  std::vector<std::uint32_t> places_in_to;  // made for the first sample whose parent is not in `from` either
  const auto source_of = [&](std::size_t i) {
    std::uint32_t sample = id[i];
    for (std::size_t place = i;;) {
      const std::uint32_t source = sample < shared_ids ? at(places, sample) : kNoSource;
      if (source != kNoSource || to.parent.empty()) return source;
      if (id[i] != sample) {
        if (places_in_to.empty()) places_in_to = places_of(to);
        place = at(places_in_to, sample);
        if (place == kNoSource) return kNoSource;
      }
      const std::uint32_t parent = to.parent[place];
      if (parent >= sample) return kNoSource;  // it was uploaded: parents come before their children
      sample = parent;
    }
  };
  std::vector<std::uint32_t> sources(id.size());
  for (std::size_t i = 0; i < id.size(); ++i) sources[i] = source_of(i);
  return sources;
}

SampleChange change_of(const SampleSet& before, const SampleSet& after) {
  const std::uint32_t next = before.sampling->next_id;
  const std::vector<std::uint32_t>& id = after.cloud().id;
  const auto inserted = static_cast<std::size_t>(
      std::count_if(id.begin(), id.end(), [&](std::uint32_t i) { return i >= next; }));
  return {.inserted = inserted, .removed = before.size() + inserted - after.size()};
}

SharedMarks carried_marks(const SampleSet& from, const SharedMarks& marks, const SampleSet& to,
                          const SharedMarks& recorded, std::uint32_t shared_ids) {
  if (are_same(from, to)) return marks;
  const auto sources = sources_of(*from.sampling, *to.sampling, shared_ids);
  Marks result = carried(*marks, sources, std::uint8_t{0});
  if (recorded != nullptr && recorded->size() == result.size()) {
    for (std::size_t i = 0; i < result.size(); ++i)
      if (sources[i] == kNoSource || from.cloud().id[sources[i]] != to.cloud().id[i])
        result[i] = (*recorded)[i];
  }
  return std::make_shared<const Marks>(std::move(result));
}

SamplesMemory::SamplesMemory(const SharedSamples& free) {
  add(free);
  bytes_ = 0;
}

std::uint64_t SamplesMemory::add(const SharedSamples& samples) {
  if (samples == nullptr || !known_.insert(samples.get()).second) return 0;
  std::uint64_t bytes = samples->stretch.size() * sizeof(float);
  if (known_.insert(samples->splat_radius.get()).second)
    bytes += samples->splat_radius->size() * sizeof(std::uint16_t);
  if (const Sampling& sampling = *samples->sampling; known_.insert(&sampling).second) {
    const std::uint64_t cloud = memory_of(*sampling.cloud);
    const std::uint64_t graph = sampling.graph->lanes.size() * sizeof(std::uint32_t);
    bytes += memory_of(sampling) - cloud - graph;
    if (known_.insert(sampling.cloud.get()).second) bytes += cloud;
    if (known_.insert(sampling.graph.get()).second) bytes += graph;
  }
  bytes_ += bytes;
  return bytes;
}

}  // namespace pointwright::server

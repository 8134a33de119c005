#include "server/sessions/named_regions.h"

#include <algorithm>

#include "engine/core/parallel.h"
#include "server/sessions/document.h"
#include "server/sessions/painter.h"
#include "server/sessions/session_params.h"

namespace pointwright::server {

using protocol::Problem;
using protocol::ProblemKind;

namespace {

/// What a region's samples are marked with while it is painted by itself.
constexpr RegionKind kOwn = RegionKind::kOne;

std::uint8_t entry_of(const SampleMask& by_id, std::uint32_t id) {
  return id < by_id.size() ? by_id[id] : std::uint8_t{0};
}

std::size_t count_of(const SampleMask& members) {
  return static_cast<std::size_t>(std::ranges::count(members, std::uint8_t{1}));
}

/// What the region had, with these samples' own entries.
std::shared_ptr<const SampleMask> with_members(const std::shared_ptr<const SampleMask>& by_id,
                                               const SampleMask& members, const SampleSet& samples) {
  auto result = std::make_shared<SampleMask>(by_id == nullptr ? SampleMask{} : *by_id);
  result->resize(std::max<std::size_t>(result->size(), samples.sampling->next_id), std::uint8_t{0});
  const std::vector<std::uint32_t>& id = samples.cloud().id;
  for (std::size_t i = 0; i < members.size(); ++i) (*result)[id[i]] = members[i];
  return result;
}

Problem wrong_operation(const std::string& pointer, const char* detail) {
  return {.kind = ProblemKind::kInvalidValue,
          .detail = detail,
          .errors = {{.pointer = pointer, .detail = detail}}};
}

}  // namespace

SampleMask members_of(const NamedRegion& region, const SampleSet& samples) {
  SampleMask members(samples.size(), 0);
  if (region.by_id == nullptr) return members;
  const std::vector<std::uint32_t>& id = samples.cloud().id;
  parallel_for(members.size(), [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) members[i] = entry_of(*region.by_id, id[i]);
  });
  return members;
}

SharedNamedRegions carried_regions(const SampleSet& from, const SharedNamedRegions& regions,
                                   const SampleSet& to, std::uint32_t shared_ids) {
  if (regions == nullptr || are_same(from, to)) return regions;
  const std::vector<std::uint32_t> sources = sources_of(*from.sampling, *to.sampling, shared_ids);
  NamedRegions carried = *regions;
  for (auto& [name, region] : carried) {
    SampleMask members = members_of(region, to);
    for (std::size_t i = 0; i < members.size(); ++i)
      if (sources[i] != kNoSource) members[i] = entry_of(*region.by_id, from.cloud().id[sources[i]]);
    region.painting.samples = count_of(members);
    region.by_id = with_members(region.by_id, members, to);
  }
  return std::make_shared<const NamedRegions>(std::move(carried));
}

SharedNamedRegions recounted(const SharedNamedRegions& regions, const SampleSet& samples) {
  if (regions == nullptr) return regions;
  NamedRegions counted = *regions;
  for (auto& [name, region] : counted) region.painting.samples = count_of(members_of(region, samples));
  return std::make_shared<const NamedRegions>(std::move(counted));
}

Outcome<Done> find_region(const Document& document, const std::string& pointer, PaintOperation& operation) {
  auto* const shape = std::get_if<RegionShape>(&operation.shape);
  if (shape == nullptr || !has_shape(operation.mode)) return Done{};
  const SampleSet& samples = *document.surface.samples;
  if (const auto kind = protocol::region_of_name(shape->source)) {
    auto members = std::make_shared<SampleMask>(samples.size(), std::uint8_t{0});
    for (std::size_t i = 0; i < members->size(); ++i)
      (*members)[i] = ((*document.marks)[i] & static_cast<unsigned>(*kind)) != 0U ? 1 : 0;
    shape->members = std::move(members);
    return Done{};
  }
  const auto found =
      document.named == nullptr ? NamedRegions::const_iterator{} : document.named->find(shape->source);
  if (document.named == nullptr || found == document.named->end())
    return wrong_operation(pointer + "/shape/region", "the session has no region of that name");
  shape->members = std::make_shared<const SampleMask>(members_of(found->second, samples));
  return Done{};
}

Outcome<NamedPainting> painted_region(const SessionParams& params, const Document& before,
                                      const std::string& name, const std::vector<PaintOperation>& operations,
                                      bool append, const ExecutionContext& context) {
  NamedRegions regions = before.named == nullptr ? NamedRegions{} : *before.named;
  if (!regions.contains(name) && regions.size() >= params.max_named_regions)
    return Problem{.kind = ProblemKind::kTooMany,
                   .detail = "the session has as many named regions as it may",
                   .limit = static_cast<double>(params.max_named_regions),
                   .actual = static_cast<double>(regions.size())};
  NamedRegion& region = regions[name];
  const SampleSet& samples = *before.surface.samples;
  const SampleMask old = members_of(region, samples);
  Marks marks(samples.size(), 0);
  if (append)
    std::ranges::transform(old, marks.begin(), [](std::uint8_t member) {
      return member != 0 ? static_cast<std::uint8_t>(kOwn) : std::uint8_t{0};
    });
  Painter painter(params, paint_surface(before.surface), {}, append ? region.painting : Painting{});
  for (std::size_t i = 0; i < operations.size(); ++i) {
    const std::string pointer = append ? "" : "/operations/" + std::to_string(i);
    PaintOperation operation = operations[i];
    if (operation.steal) return wrong_operation(pointer + "/steal", "named regions share their samples");
    if (operation.mode == PaintMode::kFlood && operation.flood.stop_at_other)
      return wrong_operation(pointer + "/stop_at_other", "a named region has no other one");
    if (auto found = find_region(before, pointer, operation); !found.ok()) return found.problem();
    if (auto painted = painter.paint(kOwn, operation, marks, context); !painted.ok())
      return painted.problem();
  }
  SampleMask members(marks.size(), 0);
  std::ranges::transform(marks, members.begin(), [](std::uint8_t mark) { return mark != 0 ? 1 : 0; });
  NamedPainting result;
  for (std::size_t i = 0; i < members.size(); ++i) result.changed += members[i] != old[i] ? 1U : 0U;
  region.painting = painter.finish(kOwn, marks);
  region.by_id = with_members(region.by_id, members, samples);
  result.regions = std::make_shared<const NamedRegions>(std::move(regions));
  return result;
}

}  // namespace pointwright::server

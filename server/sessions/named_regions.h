#pragma once
// Regions besides zero and one: paintings that are kept under names, for operations to use.

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "engine/core/execution_context.h"
#include "server/base/outcome.h"
#include "server/sessions/painting.h"
#include "server/sessions/sample_set.h"

namespace pointwright::server {

struct Document;
struct SessionParams;

/// A painting, and which samples it has: by id, so that samples that an edit removed are in it once more when
/// undo brings them back. Ids beyond the end are not in it.
struct NamedRegion {
  Painting painting;
  std::shared_ptr<const SampleMask> by_id;
};
using NamedRegions = std::map<std::string, NamedRegion, std::less<>>;
/// Null: none.
using SharedNamedRegions = std::shared_ptr<const NamedRegions>;

/// One entry for each of the samples, 0 or 1. Cost: O(N)
SampleMask members_of(const NamedRegion& region, const SampleSet& samples);

/// The regions on other samples of the session: inserted ones are where the samples are that they were split
/// from. Cost: O(N) a region, nothing where the samples are the same
SharedNamedRegions carried_regions(const SampleSet& from, const SharedNamedRegions& regions,
                                   const SampleSet& to, std::uint32_t shared_ids = kAllIds);
/// The regions with the numbers of their samples counted.
SharedNamedRegions recounted(const SharedNamedRegions& regions, const SampleSet& samples);

/// Gives the operation's shape, where it is a region, the members that the region has in the document.
/// Problem: invalid value, its pointer below `pointer`, where there is no such region
Outcome<Done> find_region(const Document& document, const std::string& pointer, PaintOperation& operation);

/// What painting came to.
struct NamedPainting {
  SharedNamedRegions regions;
  std::size_t changed = 0;  ///< samples that joined or left
};
/// The document's regions with operations painted onto one of them, which is made where there is none, or
/// with its painting replaced. Named regions share samples: nothing is stolen.
/// Problems: too many regions, operations or vertices; no such region; an operation that looks at another
///           region (invalid value)
/// Cancels:  what came out must then be dropped
Outcome<NamedPainting> painted_region(const SessionParams& params, const Document& before,
                                      const std::string& name, const std::vector<PaintOperation>& operations,
                                      bool append, const ExecutionContext& context);

}  // namespace pointwright::server

#pragma once
// The samples of a session's surface at one point of its history, what viewers are told of them, and how
// columns travel from the samples before an edit to those after it.

#include <cstdint>
#include <limits>
#include <memory>
#include <set>
#include <vector>

#include "engine/editing/painting.h"
#include "engine/multires/sampling.h"
#include "engine/multires/surface.h"

namespace pointwright::server {

/// Immutable once shared. Columns in the order of the surface's.
struct SampleSet {
  std::shared_ptr<const Sampling> sampling;
  std::shared_ptr<const std::vector<std::uint16_t>> splat_radius;  ///< at rest, bfloat16
  /// How far each sample's cell is stretched along its longer axis; empty before the first resampling.
  std::vector<float> stretch = {};
  float stretch_range = 0.0F;  ///< a power of two that no stretch exceeds; 0 where there is none

  [[nodiscard]] std::size_t size() const { return sampling->size(); }
  [[nodiscard]] const Cloud& cloud() const { return *sampling->cloud; }
  [[nodiscard]] const NeighborGraph& graph() const { return *sampling->graph; }
};
using SharedSamples = std::shared_ptr<const SampleSet>;

/// The samples that a session starts with; `rest` is where they stand.
SharedSamples samples_at_rest(Sampling sampling, const Level& rest);
/// Those that an edit with resampling left: inserted ones have the splats of their parents.
SharedSamples samples_after(const SampleSet& before, std::shared_ptr<const Sampling> after);

/// What an edit did to the samples.
struct SampleChange {
  std::size_t inserted = 0;
  std::size_t removed = 0;
};
/// Pre: `after` was made of `before` by one edit. Cost: O(N)
SampleChange change_of(const SampleSet& before, const SampleSet& after);

/// Whether they are the very same samples, however far stretched.
bool are_same(const SampleSet& a, const SampleSet& b);
/// Whether `after` starts with all samples of `before`, in their order. Cost: O(N).
bool continues(const SampleSet& before, const SampleSet& after);

/// Where a sample has no source.
inline constexpr std::uint32_t kNoSource = std::numeric_limits<std::uint32_t>::max();
/// The ids that all samplings of one session share: every one.
inline constexpr std::uint32_t kAllIds = std::numeric_limits<std::uint32_t>::max();

/// For each sample of `to` the place in `from` of that sample; where `from` has none, of the one that it was
/// split from, or that one's parent, and so on; kNoSource where none of them is there.
/// `shared_ids`: samples with ids from this on are not the same ones although their ids are: samplings whose
/// histories part have in common what was there before.
/// Cost: O(N)
std::vector<std::uint32_t> sources_of(const Sampling& from, const Sampling& to,
                                      std::uint32_t shared_ids = kAllIds);

/// The column on other samples: each has the value of its source, `missing` where it has none.
template <typename T>
std::vector<T> carried(const std::vector<T>& column, const std::vector<std::uint32_t>& sources, T missing) {
  std::vector<T> result;
  result.reserve(sources.size());
  for (const std::uint32_t source : sources) result.push_back(source == kNoSource ? missing : column[source]);
  return result;
}

using SharedMarks = std::shared_ptr<const Marks>;
/// Marks on other samples of the same session: inserted ones take their parents'. `recorded`, where given,
/// has marks of samples of `to` that `from` lacks: collected ones that an undo brings back.
SharedMarks carried_marks(const SampleSet& from, const SharedMarks& marks, const SampleSet& to,
                          const SharedMarks& recorded = nullptr, std::uint32_t shared_ids = kAllIds);

/// Adds up the memory of sample sets that share their parts: each part counts once.
class SamplesMemory {
 public:
  /// Those of `free` count nothing: others account for them. Null is nothing.
  explicit SamplesMemory(const SharedSamples& free);
  /// What counting them as well adds, bytes. Null is nothing.
  std::uint64_t add(const SharedSamples& samples);
  [[nodiscard]] std::uint64_t bytes() const { return bytes_; }

 private:
  std::set<const void*> known_;
  std::uint64_t bytes_ = 0;
};

}  // namespace pointwright::server

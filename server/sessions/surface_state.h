#pragma once
// The surface of a session at one point of its history, and the pure steps that lead from one to the next.

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "engine/core/cloud.h"
#include "engine/editing/edit.h"
#include "engine/editing/painting.h"
#include "engine/editing/scale_field.h"
#include "engine/multires/hierarchy.h"
#include "engine/resampling/resampled_edit.h"
#include "server/sessions/sample_room.h"
#include "server/sessions/sample_set.h"

namespace pointwright::server {

/// How hierarchies are built: build_hierarchy, or a cheaper stand-in in tests.
using HierarchyBuilder =
    std::function<Result<Hierarchy>(const Cloud&, const HierarchyParams&, const ExecutionContext&)>;

/// How edits with resampling are made: apply_resampled_edit, or a stand-in in tests.
using Resampler = std::function<Result<ResampledEdit>(
    const MultiresSurface&, const std::shared_ptr<const Sampling>&, const EditParams&, const ScaleField&,
    const RegionPair&, ResamplingEffort, const ExecutionContext*)>;

/// What never changes while a session lives.
struct RestModel {
  HierarchyParams params;
  Vec3d origin = Vec3d::Zero();
  float diagonal = 0.0F;           ///< of the rest cloud: what the scales are fractions of
  std::uint32_t uploaded_ids = 0;  ///< ids from this on are those of inserted samples
  /// ChosenSamples::cloud_index; null where the session has all samples of its cloud.
  std::shared_ptr<const std::vector<std::uint32_t>> cloud_index = {};
  HierarchyBuilder build;
  Resampler resample;
  std::shared_ptr<SampleRoom> room;
};

/// Immutable; copies share everything.
struct SurfaceState {
  std::shared_ptr<const MultiresSurface> surface;
  std::shared_ptr<const std::vector<DecompositionReport>> reports;
  /// Levels below this one no longer match the finer ones: an edit of a finer level moved those alone.
  std::uint32_t first_valid_level = 0;
  SharedSamples samples = {};

  friend bool operator==(const SurfaceState&, const SurfaceState&) = default;  ///< the same objects
};

/// Bytes that the state's surface takes, without its samples: states share those.
std::uint64_t memory_of(const SurfaceState& state);

/// The state with `level` valid: derives the hierarchy of the current surface where it is not. The finest
/// level keeps its bits.
/// Errors: kCancelled and those of the builder
Result<SurfaceState> with_valid_level(const RestModel& rest, const SurfaceState& state, std::uint32_t level,
                                      const ExecutionContext& context);

/// t on the samples of a level, and where it comes from. Copies share everything.
struct RegionField {
  std::shared_ptr<const ScaleField> t;
  std::shared_ptr<const RegionPair> regions;
  SharedSamples samples;  ///< whose t it is
};
/// From the marks.
/// Pre:    the level is valid
/// Errors: kEmptyRegion, kRegionsIntersect
Result<RegionField> field_of(const SurfaceState& state, std::uint32_t level, Blend blend, const Marks& marks);

/// How far from the cloud's origin an edit may take a sample, model units, summed over the axes.
inline constexpr float kMaxReach = 1e12F;
/// Errors: kInvalidArgument (field "deformation") where a sample of the levels from `level` on is farther
///         than that, or nowhere. An edited surface is the next edit's input: this is what keeps it finite.
Result<void> check_reach(const MultiresSurface& surface, std::uint32_t level);

/// The state after an edit.
/// Pre:    the level is valid and `field` belongs to it
/// Errors: of edits with resampling alone: those of the resampler, and kTooLarge (field
///         "resampling.max_samples") where the session has no room for so many samples
Result<SurfaceState> edited(const RestModel& rest, const SurfaceState& state, const EditParams& params,
                            const RegionField& field, ResamplingEffort effort,
                            const ExecutionContext& context);
/// The samples after an edit without resampling: the same ones, their cells carried along.
SharedSamples carried_samples(const SurfaceState& before, const EditParams& params, const ScaleField& field);

/// One recorded edit: all that replaying it needs.
struct RecordedEdit {
  std::size_t index = 0;  ///< 1 for the first one
  EditParams params;
  std::shared_ptr<const Marks> marks;  ///< the painting at that time
  std::chrono::system_clock::time_point created;
  std::size_t moved_samples = 0;
  std::size_t zero_samples = 0;
  std::size_t one_samples = 0;
  SampleChange change;
  std::size_t sample_count = 0;  ///< after it
  std::string surface_hash;      ///< after it: surface_hash()
};

/// The record of an edit that leads from one state to the next.
std::shared_ptr<const RecordedEdit> record_of(std::size_t index, const EditParams& params, SharedMarks marks,
                                              const SurfaceState& before, const SurfaceState& after,
                                              std::chrono::system_clock::time_point created);

/// All the steps of an edit from its record: the same bits as when it was made.
Result<SurfaceState> replayed(const RestModel& rest, const SurfaceState& before, const RecordedEdit& record,
                              const ExecutionContext& context);

/// Samples of both states whose finest position or normal differs. Cost: O(N).
std::size_t count_moved(const SurfaceState& before, const SurfaceState& after);

}  // namespace pointwright::server

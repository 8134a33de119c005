#pragma once
// Painting the zero- and the one-region onto the samples of a surface (§4).

#include <cstdint>
#include <optional>
#include <vector>

#include "engine/core/execution_context.h"
#include "engine/core/points.h"
#include "engine/core/result.h"
#include "engine/editing/shape.h"

namespace pointwright {

/// The two regions, as bits of a sample's mark.
enum class RegionKind : std::uint8_t { kZero = 1, kOne = 2 };

/// Per sample, which regions it is painted with: RegionKind bits. N entries.
using Marks = std::vector<std::uint8_t>;

enum class PaintMode {
  kAdd,        ///< samples in the shape join the region
  kRemove,     ///< samples in the shape leave it
  kIntersect,  ///< samples outside the shape leave it
  kSet,        ///< exactly the samples in the shape
};

struct PaintOperation {
  PaintMode mode = PaintMode::kAdd;
  Shape shape;
  /// Only samples whose normal has a positive component along this direction (toward the viewer): a brush
  /// that does not paint through thin sheets. Off where not given.
  std::optional<Vec3d> facing;
  /// Samples that join this region leave the other one. Without it they end up in both, which an edit
  /// refuses.
  bool steal = false;
};

/// Errors: those of the shape; kInvalidArgument for a zero `facing`.
Result<void> validate(const PaintOperation& operation);

/// Applies one operation to the marks of `kind`. Returns how many samples changed their mark.
/// Shapes:      positions relative to `origin`; normals of the same surface (read only for `facing`)
/// Cost:        O(N), parallel over samples. A stroke of V vertices adds O(V log V) to sort its segments
///              once, O(log V) for each range of kParallelBlock samples, and a test of each of a block's 128
///              samples against the segments within the radius of that block. Long segments whose bounding
///              boxes hold all samples are each tested once a range; where all of them pass through all
///              blocks it is O(N V)
/// Determinism: bitwise equal for any thread count
/// Cancels:     between blocks of samples; the marks are then incomplete and must be dropped
std::size_t paint(const PaintOperation& operation, RegionKind kind, const Points& position,
                  const Points& normal, const Vec3d& origin, Marks& marks,
                  const ExecutionContext* context = nullptr);

/// Samples painted with `kind`. Cost: O(N).
std::size_t count_marked(const Marks& marks, RegionKind kind);

}  // namespace pointwright

#pragma once
// Painting the zero- and the one-region onto the samples of a surface (§4).

#include <cstdint>
#include <optional>
#include <vector>

#include "engine/core/execution_context.h"
#include "engine/core/points.h"
#include "engine/core/result.h"
#include "engine/editing/shape.h"
#include "engine/spatial/neighbor_graph.h"

namespace pointwright {

/// The two regions, as bits of a sample's mark.
enum class RegionKind : std::uint8_t { kZero = 1, kOne = 2 };

/// Per sample, which regions it is painted with: RegionKind bits. N entries.
using Marks = std::vector<std::uint8_t>;
/// A set of samples: one entry each, 0 or 1.
using SampleMask = std::vector<std::uint8_t>;

enum class PaintMode {
  kAdd,        ///< samples in the shape join the region
  kRemove,     ///< samples in the shape leave it
  kIntersect,  ///< samples outside the shape leave it
  kSet,        ///< exactly the samples in the shape
  kInvert,     ///< members leave, all others join
  kClear,      ///< all leave
  kGrow,       ///< samples within `distance` of a member join
  kShrink,     ///< members within `distance` of a sample that is none leave
  kFlood,      ///< samples that `flood` reaches join
};

/// Fills the surface from the sample nearest to the seed, over neighbours; any combination of bounds.
struct FloodFill {
  Vec3d seed = Vec3d::Zero();
  std::optional<double> angle_rad;  ///< not across a greater angle between the normals of neighbours
  std::optional<double> radius;     ///< only within this distance of the seed
  bool stop_at_other = false;       ///< not onto samples of the other region
};

/// Whether the mode paints with a shape.
bool has_shape(PaintMode mode);
/// Whether the mode reads `distance`.
bool has_distance(PaintMode mode);

struct PaintOperation {
  PaintMode mode = PaintMode::kAdd;
  Shape shape = Everything{};  ///< of the modes that have one
  /// Only samples whose normal has a positive component along this direction (toward the viewer): a brush
  /// that does not paint through thin sheets. Off where not given; only modes with a shape have it.
  std::optional<Vec3d> facing;
  /// Samples that join this region leave the other one. Without it they end up in both, which an edit
  /// refuses.
  bool steal = false;
  double distance = 0.0;  ///< of kGrow and kShrink, model units
  FloodFill flood = {};   ///< of kFlood
};

/// Errors: those of the shape; kInvalidArgument for a zero `facing`, for one without a shape (field "facing")
/// and for a distance that is not greater than 0 (field "distance"); kNonFinite, kOutOfRange; the fields of a
/// flood are "seed", "angle" and "radius".
Result<void> validate(const PaintOperation& operation);

/// Whether what the operation covers follows from where the samples stand, not from their places in model
/// space alone: on another sampling, or once the surface moved, it may cover another part of the surface.
bool depends_on_sampling(const PaintOperation& operation);

/// The surface that is painted: its columns belong to the caller.
struct PaintSurface {
  const Points& position;  ///< relative to `origin`
  const Points& normal;    ///< read only for `facing` and for angles
  const Vec3d& origin;
  const NeighborGraph* graph = nullptr;  ///< of its samples; read only for kFlood and what is `visible`
  const std::vector<TexCoord>* texcoord = nullptr;  ///< one a sample, or null or empty: none
};

/// The samples that an operation covers: those in its shape that pass its filters, those that growing takes
/// in, shrinking gives up or a flood reaches; none where the mode covers nothing. Pre, Cost, Determinism,
/// Cancels: those of paint()
SampleMask covered_samples(const PaintOperation& operation, RegionKind kind, const PaintSurface& surface,
                           const Marks& marks, const ExecutionContext* context = nullptr);

/// Applies one operation to the marks of `kind`. Returns how many samples changed their mark.
/// Pre:         validate(operation); its image, model or region was found, the region's samples being the
///              surface's; texture coordinates where it needs them
/// Cost:        O(N), parallel over samples. A stroke or point set of V vertices adds O(V log V) to sort its
///              segments once, O(log V) for each range of kParallelBlock samples, and a test of each of a
///              block's 128 samples against the segments within the radius of that block. Long segments whose
///              bounding boxes hold all samples are each tested once a range; where all of them pass through
///              all blocks it is O(N V). A model of M samples: O(M) once, O(log M) a
///              sample near it. Growing and shrinking: near_members(),
///              filling: flood_fill()
/// Determinism: bitwise equal for any thread count
/// Cancels:     between blocks of samples; the marks are then incomplete and must be dropped
std::size_t paint(const PaintOperation& operation, RegionKind kind, const PaintSurface& surface, Marks& marks,
                  const ExecutionContext* context = nullptr);

/// Samples painted with `kind`. Cost: O(N).
std::size_t count_marked(const Marks& marks, RegionKind kind);

}  // namespace pointwright

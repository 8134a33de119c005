#pragma once
// Point set simplification (§3.2): pairs of neighbours are contracted under error quadrics, and every
// contraction can be undone.

#include <cstddef>
#include <cstdint>
#include <variant>
#include <vector>

#include "engine/core/execution_context.h"
#include "engine/core/points.h"
#include "engine/core/result.h"
#include "engine/spatial/neighbor_graph.h"

namespace pointwright {

/// Where simplification ends: exactly one of these three.
struct KeepCount {
  std::size_t count = 1;  ///< samples to keep, at least 1; N or more keeps every sample as it is
  friend bool operator==(const KeepCount&, const KeepCount&) = default;
};
struct KeepRatio {
  double ratio = 0.5;  ///< of the samples, in (0, 1]; rounded to the nearest count, at least 1
  friend bool operator==(const KeepRatio&, const KeepRatio&) = default;
};
struct KeepWithin {
  /// Model units, finite and not negative. Bounds Contraction::error of every contraction: what survives
  /// lies no farther than this (root mean square) from the planes of any single sample that it stands for.
  float error = 0.0F;
  friend bool operator==(const KeepWithin&, const KeepWithin&) = default;
};
/// How many of N samples these keep.
std::size_t kept_of(const KeepCount& target, std::size_t sample_count);
std::size_t kept_of(const KeepRatio& target, std::size_t sample_count);
using SimplifyTarget = std::variant<KeepCount, KeepRatio, KeepWithin>;

enum class ContractionOrder {
  kGreedy,   ///< one pair at a time, the cheapest first (a heap): the reference
  kBatched,  ///< rounds of independent pairs, each the best of both its samples; parallel
};

enum class Placement {
  kQuadricMinimum,  ///< as in §3.2: where the error is least, which on curved surfaces is outside of them
  /// Halfway from there, along the normal, to the mean of what the sample stands for, which is as far inside:
  /// on the surface to third order, nearer in both directions. Creases and corners keep the minimum.
  kOnSurface,
};

struct SimplifyParams {
  SimplifyTarget target = KeepRatio{0.5};
  ContractionOrder order = ContractionOrder::kBatched;
  /// Adds this times the squared distance of the pair to its cost, in [0, 10]. 0: pure quadrics, as in §3.2,
  /// few samples on flats, where chance decides. 1e-3 spreads those evenly, so that one sample never comes to
  /// stand for a whole flat, and changes a curved surface by a hundredth of its error; with 1e-5 edges keep
  /// more of the samples. 0.05 keeps the whole result even, as smoothing on it wants.
  float length_weight = 1e-3F;
  Placement placement = Placement::kOnSurface;
  /// Never contracts a pair with n_i . n_j < 0, which stand on two sheets of a thin part, and lets them span
  /// no plane together. Wants consistently oriented normals; with false their sides do not count.
  bool separate_sheets = true;
  friend bool operator==(const SimplifyParams&, const SimplifyParams&) = default;
};

/// Errors: kInvalidArgument with the field at fault.
Result<void> validate(const SimplifyParams& params);

/// One contraction (a, b) -> a: sample a moves and stands for both, sample b is gone.
struct Contraction {
  std::uint32_t survivor = 0;  ///< a, index into the input; a < b
  std::uint32_t removed = 0;   ///< b
  /// sqrt(Q_a + Q_b) at the new position, model units (ContractionRecord says what Q is).
  float error = 0.0F;
};

/// What re-inserting needs, in the order of contraction.
struct ContractionRecord {
  std::vector<Contraction> steps;
  Points position;  ///< of the survivor after each step, where the quadric is least
  Points normal;
  /// The neighbourhood that the survivor inherited from both, bounded: compressed rows of input indices.
  std::vector<std::uint64_t> neighbor_first;  ///< steps + 1
  std::vector<std::uint32_t> neighbor;
};

struct Simplification {
  std::vector<std::uint32_t> kept;    ///< M survivors: indices into the input, ascending
  Points position;                    ///< M: where the survivors stand; untouched ones keep their bits
  Points normal;                      ///< M unit normals: the means over what they stand for
  std::vector<std::uint32_t> parent;  ///< N: of every input sample, its survivor as an index into `kept`
  ContractionRecord record;
  Placement placement = Placement::kOnSurface;
};

/// Paper:       §3.2. Q_p, the quadric of a sample: the mean squared distance to the planes through p that
///              are spanned by e_i = p - p_i and b_i = e_i x n, one for each neighbour p_i. Contracting adds
///              quadrics and merges neighbourhoods; the new sample stands where the sum is least. Where it
///              does not say (flats, along creases) the pair's weighted mean does
/// Shapes:      N samples in coherent order, N unit normals, their graph. More than the target are kept only
///              where the rest are opposed sheets; far parts are joined when their own samples are used up
/// Errors:      kInvalidArgument, kTooLarge (2^27 samples), kCancelled
/// Cost:        kGreedy O(N k log N), one thread; kBatched O(N k), parallel; about 270 bytes a sample while
///              it runs
/// Determinism: bitwise equal for any thread count and instruction set
/// Cancels:     between rounds and between blocks of samples
Result<Simplification> simplify(const Points& position, const Points& normal, const NeighborGraph& graph,
                                const SimplifyParams& params, const ExecutionContext* context = nullptr);

/// Undoes contractions, the last one first, until `count` samples are there (§3.3, the inverse of Psi).
/// Samples come back bit by bit as they were; the record ends with the contractions that are still done.
/// Pre:  position and normal are those that `simplified` was made of; M <= count <= N
/// Cost: O(N)
Simplification reinsert(const Simplification& simplified, const Points& position, const Points& normal,
                        std::size_t count);

/// Neighbours of every sample that is left, ascending: row m is neighbor[first[m]] .. neighbor[first[m + 1]].
struct Neighborhoods {
  std::vector<std::size_t> first;
  std::vector<std::uint32_t> neighbor;  ///< indices into `kept`
  friend bool operator==(const Neighborhoods&, const Neighborhoods&) = default;
};

/// The neighbourhoods that contraction has led to, made symmetric: samples are neighbours where either has
/// inherited the other. They follow from which contractions are done alone, so re-insertion restores them.
/// Pre:  graph is the one that `simplified` was made with
/// Cost: O(N + M k log k)
Neighborhoods neighborhoods(const Simplification& simplified, const NeighborGraph& graph);

}  // namespace pointwright

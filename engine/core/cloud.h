#pragma once
// The cloud: what a file holds and what an edit changes. Structure of arrays, in spatially coherent order.

#include <array>
#include <cstdint>
#include <string>
#include <variant>
#include <vector>

#include "engine/core/points.h"
#include "engine/core/result.h"

namespace pointwright {

/// A named scalar per sample, in the type of the file it came from: it leaves with the bits it came with.
struct ScalarAttribute {
  using Values = std::variant<std::vector<std::int8_t>, std::vector<std::uint8_t>, std::vector<std::int16_t>,
                              std::vector<std::uint16_t>, std::vector<std::int32_t>,
                              std::vector<std::uint32_t>, std::vector<float>, std::vector<double>>;
  std::string name;
  Values values;

  [[nodiscard]] std::size_t size() const {
    return std::visit([](const auto& v) { return v.size(); }, values);
  }
  friend bool operator==(const ScalarAttribute&, const ScalarAttribute&) = default;
};

using Rgba = std::array<std::uint8_t, 4>;
using TexCoord = std::array<float, 2>;

/// A cloud of N samples. Every non-empty column has N entries, all in the same order.
/// Positions are float32 relative to `origin` (model units): sample i stands at origin + position[i].
struct Cloud {
  Vec3d origin = Vec3d::Zero();
  Points position;
  Points normal;            ///< empty, or N unit vectors
  std::vector<Rgba> color;  ///< empty, or N; alpha 255 where the file had none
  bool color_has_alpha = false;
  std::vector<TexCoord> texcoord;        ///< empty, or N
  std::vector<ScalarAttribute> scalars;  ///< every further property of the file, by name
  /// Stable id of each sample: its index in the caller's order, all distinct; those of samples that were
  /// inserted afterwards follow.
  std::vector<std::uint32_t> id;
  /// The positions as the file had them, 3 per sample, where origin + position does not give them back to the
  /// bit (double-precision files, and float files that lie far from zero). Empty where it does.
  std::vector<std::array<double, 3>> exact_position;
  bool position_is_double = false;  ///< the file's positions were float64, and leave as float64

  [[nodiscard]] std::size_t size() const { return position.size(); }
  [[nodiscard]] bool has_normals() const { return !normal.empty(); }
  [[nodiscard]] bool has_colors() const { return !color.empty(); }
};

/// The position of sample i in model space: the exact one where the file had more precision than float32.
Vec3d model_position(const Cloud& cloud, std::size_t i);

/// All columns of the cloud in another order: sample i of the result is sample order[i] of the input.
/// Pre:  order is a permutation of 0..N-1 (or of a subset: then the result is that subset)
/// Cost: O(N)
Cloud permuted(const Cloud& cloud, const std::vector<std::uint32_t>& order);

/// The cloud in its caller's order (ascending id). Cost: O(N).
Cloud in_caller_order(const Cloud& cloud);

/// Bytes that the columns take.
std::uint64_t memory_of(const Cloud& cloud);

/// Column lengths agree, ids are distinct, every position is finite. Errors: kMalformedData, kNonFinite.
Result<void> validate(const Cloud& cloud);

}  // namespace pointwright

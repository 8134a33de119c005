#pragma once
// Working state of the smoother: one sample in one vector of four floats, so that fetching a neighbour is a
// single load. Four floats are the vector that every machine has, so there is one kernel, not one for each
// instruction set.

#include <cstddef>
#include <vector>

#include "engine/core/points.h"

namespace pointwright {

/// x y z and a fourth lane that the smoother ignores.
typedef float Float4 __attribute__((vector_size(16)));  // NOLINT(modernize-use-using): gcc wants it so

/// N samples, padded to a whole block; one more entry, always 0, stands for "no sample".
class Packed {
 public:
  Packed() = default;
  explicit Packed(std::size_t count) : count_(count), values_(padded_to_block(count) + 1, Float4{}) {}
  /// Cost: O(N), parallel.
  explicit Packed(const Points& points);

  [[nodiscard]] std::size_t size() const { return count_; }
  /// The index of the entry that is 0.
  [[nodiscard]] std::size_t nothing() const { return values_.size() - 1; }
  [[nodiscard]] const Float4* data() const { return values_.data(); }
  [[nodiscard]] Float4* data() { return values_.data(); }
  [[nodiscard]] Vec3f operator[](std::size_t i) const {
    const Float4 v = values_[i];
    return {v[0], v[1], v[2]};
  }

  /// Cost: O(N), parallel.
  [[nodiscard]] Points unpacked() const;

 private:
  std::size_t count_ = 0;
  std::vector<Float4> values_;
};

/// along * (along . v), in the first three lanes.
inline Float4 component_along(const Float4& along, const Float4& v) {
  const Float4 product = along * v;
  return along * ((product[0] + product[1]) + product[2]);
}

}  // namespace pointwright

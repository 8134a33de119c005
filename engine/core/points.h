#pragma once
// A column of 3-vectors as three float arrays, padded to whole SIMD blocks.

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/core/vector.h"

namespace pointwright {

/// Samples that every vectorised kernel handles together; independent of the machine, so that the bytes are
/// too.
inline constexpr std::size_t kSimdBlock = 16;

/// n rounded up to whole SIMD blocks.
constexpr std::size_t padded_to_block(std::size_t n) {
  return (n + kSimdBlock - 1) / kSimdBlock * kSimdBlock;
}

/// N 3-vectors, structure of arrays. The arrays are padded to a whole number of SIMD blocks; the padding
/// holds finite values (0 unless written) and is never part of the cloud.
class Points {
 public:
  Points() = default;
  explicit Points(std::size_t count) { resize(count); }

  void resize(std::size_t count) {
    count_ = count;
    for (auto* column : {&x_, &y_, &z_}) column->resize(padded_to_block(count), 0.0F);
  }
  [[nodiscard]] std::size_t size() const { return count_; }
  [[nodiscard]] bool empty() const { return count_ == 0; }

  [[nodiscard]] Vec3f operator[](std::size_t i) const { return {x_[i], y_[i], z_[i]}; }
  void set(std::size_t i, const Vec3f& p) {
    x_[i] = p.x();
    y_[i] = p.y();
    z_[i] = p.z();
  }

  /// The padded columns: padded_to_block(size()) floats each.
  [[nodiscard]] const float* x() const { return x_.data(); }
  [[nodiscard]] const float* y() const { return y_.data(); }
  [[nodiscard]] const float* z() const { return z_.data(); }
  [[nodiscard]] float* x() { return x_.data(); }
  [[nodiscard]] float* y() { return y_.data(); }
  [[nodiscard]] float* z() { return z_.data(); }

  /// Of the points alone: what the padding holds does not count.
  friend bool operator==(const Points& a, const Points& b) {
    const auto same = [&](const std::vector<float>& u, const std::vector<float>& v) {
      return std::equal(u.begin(), u.begin() + static_cast<std::ptrdiff_t>(a.count_), v.begin());
    };
    return a.count_ == b.count_ && same(a.x_, b.x_) && same(a.y_, b.y_) && same(a.z_, b.z_);
  }

 private:
  std::size_t count_ = 0;
  std::vector<float> x_, y_, z_;
};

/// The axis-aligned box of all points. Cost: O(N).
Box3f bounds_of(const Points& points);

}  // namespace pointwright

#pragma once
// The few nearest of many candidates.

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>

namespace pointwright {

/// At most Most samples by ascending distance, ties by the lower index. Whoever is offered twice at the same
/// distance counts once.
template <std::uint32_t Most>
class NearestFew {
 public:
  explicit NearestFew(std::uint32_t wanted) : wanted_(std::min(wanted, Most)) {}

  /// `distance`: or its square, but for all alike.
  void consider(float distance, std::uint32_t sample) {
    if (distance > worst_) return;  // most are
    if (wanted_ == 0 || (count_ == wanted_ && !before(distance, sample, count_ - 1))) return;
    std::uint32_t place = count_;
    while (place > 0 && before(distance, sample, place - 1)) --place;
    if (place > 0 && sample_[place - 1] == sample) return;
    if (count_ < wanted_) ++count_;
    for (std::uint32_t later = count_ - 1; later > place; --later) {
      distance_[later] = distance_[later - 1];
      sample_[later] = sample_[later - 1];
    }
    distance_[place] = distance;
    sample_[place] = sample;
    if (count_ == wanted_) worst_ = distance_[count_ - 1];
  }

  [[nodiscard]] std::uint32_t count() const { return count_; }
  [[nodiscard]] std::uint32_t operator[](std::uint32_t place) const { return sample_[place]; }

 private:
  [[nodiscard]] bool before(float distance, std::uint32_t sample, std::uint32_t place) const {
    return distance < distance_[place] || (distance == distance_[place] && sample < sample_[place]);
  }

  std::uint32_t wanted_;
  std::uint32_t count_ = 0;
  float worst_ = std::numeric_limits<float>::infinity();  // that can still be among them
  std::array<float, Most> distance_{};
  std::array<std::uint32_t, Most> sample_{};
};

}  // namespace pointwright

#pragma once
// What differs between two surfaces of the same samples, as bits that turn either of them into the other. One
// of the two may have further samples after those.

#include <cstddef>
#include <cstdint>
#include <vector>

#include "engine/multires/surface.h"

namespace pointwright {

/// The exclusive or of two surfaces, kept for the blocks of kSimdBlock samples that differ alone: of every
/// level the positions and the normals, of every band the detail. Samples that one of the two has beyond
/// those of the other are kept as they are. A step of a history in the memory of what it moved or inserted. A
/// pure value.
class SurfaceDelta {
 public:
  /// Of two equal surfaces without samples.
  SurfaceDelta() = default;
  /// Shapes:      as many levels and bands on both sides; of N and N + C samples, the first N are the same
  ///              ones
  /// Cost:        O(N) a column to compare, 64 bytes for each block of a column that differs
  /// Determinism: bitwise equal for any thread count
  SurfaceDelta(const MultiresSurface& a, const MultiresSurface& b);

  /// Turns `a` into `b` and `b` into `a`, to the bit (padding included). Which of the two a surface is, is
  /// told by its number of samples where that differs.
  /// Errors: a LogicError for a surface that is neither, as far as the blocks that differ tell; it is then
  ///         no surface any more and must be dropped
  /// Cost:   O(blocks that differ), parallel; where samples are appended besides a copy of the columns
  void apply(MultiresSurface& surface) const;

  /// Whether the two surfaces are the same, to the bit.
  [[nodiscard]] bool empty() const { return blocks_ == 0 && most_ == least_; }
  /// Samples that one of the two has beyond those of the other.
  [[nodiscard]] std::size_t further_samples() const { return most_ - least_; }
  /// Blocks that differ, over all columns.
  [[nodiscard]] std::size_t blocks() const { return blocks_; }
  /// Bytes that it takes.
  [[nodiscard]] std::uint64_t memory() const;

  friend bool operator==(const SurfaceDelta&, const SurfaceDelta&) = default;

 private:
  /// One column of floats; all empty where nothing differs.
  struct Column {
    std::vector<std::uint64_t> changed;  ///< a bit for each block
    std::vector<std::uint32_t> first;    ///< for each word of `changed`: differing blocks before it
    std::vector<std::uint32_t> bits;     ///< a ^ b, kSimdBlock entries for each differing block

    friend bool operator==(const Column&, const Column&) = default;
  };
  /// What the blocks that differ held: tells a surface that is neither `a` nor `b`.
  struct Sums {
    std::uint64_t a = 0;
    std::uint64_t b = 0;

    friend Sums operator+(const Sums& x, const Sums& y) { return {x.a + y.a, x.b + y.b}; }
    friend bool operator==(const Sums&, const Sums&) = default;
  };
  struct Pair;

  static Sums compare(const Pair& pair, std::size_t number, Column& column);
  void append_tail(MultiresSurface& surface) const;

  std::vector<Column> columns_;
  std::vector<std::vector<float>> tail_;  ///< of each column, what follows the samples of the smaller surface
  std::size_t least_ = 0;                 ///< samples of the smaller surface
  std::size_t most_ = 0;                  ///< samples of the larger one
  std::size_t blocks_ = 0;
  Sums sums_;
};

}  // namespace pointwright

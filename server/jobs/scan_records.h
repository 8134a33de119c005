#pragma once
// A scan file as records of one length: where each sample's position and normal stand in it, and how they are
// replaced. Files of any size are read and written record by record.

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "engine/core/result.h"
#include "engine/core/vector.h"
#include "engine/io/cloud_io.h"
#include "engine/io/ply.h"
#include "engine/io/text.h"

namespace pointwright::server {

/// Binary PLY of either byte order, whose vertices have no lists, and LAS.
struct ScanRecords {
  CloudFormat format = CloudFormat::kPly;
  std::uint64_t count = 0;         ///< samples
  std::uint64_t record_bytes = 0;  ///< of each
  std::uint64_t begin = 0;         ///< the first record's first byte

  [[nodiscard]] std::uint64_t end() const { return begin + count * record_bytes; }
  [[nodiscard]] bool has_normals() const { return has_normals_; }
  /// Positions are float64, or whole numbers on a grid: float32 may lose bits of them.
  [[nodiscard]] bool is_fine() const { return grid_ || position_[0].type == ScalarType::kDouble; }

  [[nodiscard]] Vec3d position(const std::byte* record) const;
  [[nodiscard]] Vec3f normal(const std::byte* record) const;  ///< Pre: has_normals()
  void set_position(std::byte* record, const Vec3d& position) const;
  void set_normal(std::byte* record, const Vec3f& normal) const;  ///< Pre: has_normals()
  /// A number in every record.
  struct Place {
    std::uint64_t byte = 0;
    ScalarType type = ScalarType::kFloat;
  };
  /// What lies between two samples where one is inserted there, beside position and normal: floating-point
  /// numbers and colours. All else is one sample's or the other's.
  [[nodiscard]] std::span<const Place> mixed() const { return mixed_; }
  [[nodiscard]] const std::optional<std::array<Place, 2>>& texture() const { return texture_; }
  /// Whether the file stays whole with another number of records: nothing behind them counts them.
  [[nodiscard]] bool can_grow() const { return can_grow_; }

  /// Of the byte that says which return a LAS point is of.
  [[nodiscard]] unsigned return_mask() const { return return_mask_; }

  [[nodiscard]] double number(const std::byte* record, const Place& place) const;
  /// Whole numbers take the nearest that they can say.
  void set_number(std::byte* record, const Place& place, double value) const;
  /// Whether a position can be said in such a record: whole numbers have an end.
  [[nodiscard]] bool can_say(const Vec3d& position) const;

  /// Of the file with these bytes; nullopt where its records have no one length (text, lists, compression).
  /// Errors: those of its header
  static Result<std::optional<ScanRecords>> of(std::span<const std::byte> bytes);

 private:
  void find_mixed(const PlyElement& vertex);
  static Result<std::optional<ScanRecords>> of_ply(std::span<const std::byte> bytes);
  static Result<std::optional<ScanRecords>> of_las(std::span<const std::byte> bytes);

  std::array<Place, 3> position_;
  std::array<Place, 3> normal_;
  std::vector<Place> mixed_;
  std::optional<std::array<Place, 2>> texture_;
  unsigned return_mask_ = 0;
  bool has_normals_ = false;
  bool can_grow_ = true;
  bool swap_ = false;
  std::optional<PositionGrid> grid_;
};

}  // namespace pointwright::server

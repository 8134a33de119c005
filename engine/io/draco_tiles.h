#pragma once
// A cloud in tiles: a ZIP archive of Draco files, one for each part of space, and an index that says what
// lies where. Each tile is a file of its own for every program that reads Draco.

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "engine/core/result.h"
#include "engine/core/vector.h"
#include "engine/io/cloud_io.h"
#include "engine/io/columns.h"
#include "engine/io/zip_archive.h"

namespace pointwright {

/// The index's name in the archive: its first file.
inline constexpr std::string_view kDracoTilesIndex = "index.csv";
/// Samples of a tile, at most, as it is written.
inline constexpr std::uint32_t kMostTileSamples = std::uint32_t{1} << 19U;

/// A line of the index.
struct DracoTile {
  std::string file;  ///< its name in the archive
  std::uint64_t sample_count = 0;
  Vec3d min = Vec3d::Zero();  ///< of its samples; model space
  Vec3d max = Vec3d::Zero();
};

/// The name of the k-th tile's file.
std::string draco_tile_name(std::size_t k);

/// A line with the columns' names, "file,sample_count,min_x,min_y,min_z,max_x,max_y,max_z", and one for each
/// tile.
std::string draco_tiles_index(std::span<const DracoTile> tiles);

/// Errors: kMalformedData (with the line), kEmptyCloud, kTooLarge where the tiles claim more samples or are
///         more than 2^18
Result<std::vector<DracoTile>> parse_draco_tiles_index(std::string_view text, std::uint64_t max_samples);

/// Whether the bytes begin as such an archive does.
bool looks_like_draco_tiles(std::span<const std::byte> bytes);

/// The tiles of an archive, as bytes.
class DracoTilesReader {
 public:
  /// The bytes must outlive the reader. Errors: those of ZipReader and of the index
  static Result<DracoTilesReader> open(std::span<const std::byte> bytes, std::uint64_t max_samples);

  [[nodiscard]] const std::vector<DracoTile>& tiles() const { return tiles_; }
  [[nodiscard]] std::uint64_t sample_count() const;

  struct Piece {
    std::size_t tile = 0;
    std::vector<std::byte> bytes;  ///< a Draco file
  };
  /// Every tile once, in the order of their places in the archive; nullopt behind the last.
  /// Errors: those of ZipReader; kMalformedData where a tile of the index is missing or there twice;
  ///         kTooLarge beyond 1 KiB a sample
  Result<std::optional<Piece>> next();

 private:
  DracoTilesReader(ZipReader zip, std::vector<DracoTile> tiles);

  ZipReader zip_;
  std::vector<DracoTile> tiles_;
  std::map<std::string, std::size_t> places_;  // the tiles', by name
  std::vector<bool> is_read_;
};

/// The samples begin .. end - 1 as a cloud of their own.
Cloud part_of(const Cloud& cloud, std::uint32_t begin, std::uint32_t end);

/// The tile that this cloud is. Pre: not empty
DracoTile draco_tile_of(const Cloud& cloud, std::string file);

/// The archive of these tiles, whose files have so many bytes each. Errors: those of write_zip()
Result<void> write_draco_tiles_archive(
    std::span<const DracoTile> tiles, std::span<const std::uint64_t> bytes,
    const std::function<Result<std::vector<std::byte>>(std::size_t)>& content, const ByteSink& sink);

/// The error of a tile's file, which then names it.
Error in_tile(Error error, const DracoTile& tile);

/// The tile's samples as named columns in the file's order: x, y and z as float64 in model space, then what
/// else its cloud holds.
/// Errors: kMalformedData where the cloud has another number of samples than the index says
Result<std::vector<ScalarAttribute>> tile_columns(const Cloud& cloud, const DracoTile& tile);

/// The places of the wanted columns among the tile's. Errors: kMalformedData where one of either is missing
/// in the other or has another type
Result<std::vector<std::size_t>> match_columns(std::span<const ScalarAttribute> wanted,
                                               std::span<const ScalarAttribute> columns,
                                               const DracoTile& tile);

/// The whole cloud, tile after tile in the order of the index. All tiles hold the same columns.
/// Errors: those of DracoTilesReader, read_draco(), tile_columns() and match_columns()
Result<ImportedCloud> read_draco_tiles(std::span<const std::byte> bytes, const ImportParams& params);

/// Tiles of at most kMostTileSamples in the cloud's coherent order; write_draco() for each.
/// Errors: those of write_draco()
Result<std::vector<std::byte>> write_draco_tiles(const Cloud& cloud, int position_bits);

}  // namespace pointwright

#pragma once
// A scan's samples on disk, tile by tile, and what became of them.

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "engine/core/cloud.h"
#include "engine/core/execution_context.h"
#include "engine/core/result.h"
#include "server/jobs/mapped_file.h"
#include "server/jobs/scan_records.h"
#include "server/jobs/team.h"
#include "server/jobs/tile_cuts.h"

namespace pointwright::server {

/// A sample in a tile, or where it came to stand. Native layout: these files never leave the machine's job.
struct TileSample {
  std::uint64_t index = 0;          ///< in the scan
  std::array<float, 3> position{};  ///< relative to the script's origin
  std::array<float, 3> normal{};    ///< zero where the scan has none
};
static_assert(sizeof(TileSample) == 32);

/// A sample of the preview that stands where one of the scan does, or nearly, and how far the two came apart.
struct PreviewMatch {
  std::uint32_t anchor = 0;
  float rest_distance = 0.0F;  ///< model units, before the edits
  float difference = 0.0F;     ///< of what the edits did to each, model units
};
static_assert(sizeof(PreviewMatch) == 12);

/// What the edits made of one tile.
struct TileResult {
  std::vector<TileSample> moved;       ///< samples that came out otherwise than they went in, by index
  std::vector<std::uint64_t> removed;  ///< samples that were collected, ascending
  /// Of each inserted sample the one that it descends from, ascending; and their records, one after another.
  std::vector<std::uint64_t> roots;
  std::vector<std::byte> records;
  std::vector<PreviewMatch> matches;  ///< by anchor
  /// After each edit whose number of samples has a limit: the tile's own and those that descend from them.
  std::vector<std::uint64_t> counts;
};

/// The samples that one tile's work needs.
struct TileInput {
  /// Own samples and those around them, in coherent order; ids are in the order of the scan.
  std::shared_ptr<Cloud> cloud;
  std::vector<std::uint64_t> index;     ///< in the scan, of each
  std::vector<std::uint32_t> by_index;  ///< the tile's own samples, in the scan's order
};

/// In a folder of its own. One team writes it.
class TileStore {
 public:
  /// `origin`: what positions in tiles are relative to.
  TileStore(std::string folder, TileCuts cuts, const Vec3d& origin);

  /// Whether sort() has come to its end in this folder before, with so many samples.
  [[nodiscard]] bool is_sorted(std::uint64_t samples);
  /// Whether a store writes files of that name into its folder, or a job beside it.
  [[nodiscard]] static bool is_ours(const std::filesystem::path& path);
  /// Deletes all of them in the folder: first what says that it is whole.
  static void clear(const std::string& folder);
  /// The leader's, before anybody sorts. Errors: those of sort()
  [[nodiscard]] Result<void> begin() const;
  /// One pass over the scan: every sample into its tile, with its whole record where they are to be read tile
  /// by tile. Done by all of the team.
  /// Errors: kTooLarge (the disk is full; field "path"), kInvalidArgument (it cannot be written), kCancelled
  /// Cost:   32 bytes of disk a sample, and 36 of memory for 2^22 samples; with records their bytes of disk
  ///         besides, and 128 MiB of memory
  Result<void> sort(const MappedFile& file, const ScanRecords& records, Team& team,
                    const ExecutionContext& context, bool with_records = false);
  /// The leader's, once all have sorted: from then on the folder is sorted. Errors: those of sort()
  [[nodiscard]] Result<void> finish() const;

  [[nodiscard]] std::size_t tile_count() const { return cuts_.tile_count(); }
  [[nodiscard]] std::uint64_t sample_count(std::size_t tile) const;  ///< once sorted

  /// The tile's samples and those of other tiles within `rings` neighbourhoods of `neighbors` samples around
  /// them; a neighbourhood reaches at least as far as `least_ring`. Where the whole scan's box is given, two
  /// samples have the same order in every tile. Errors: kInvalidArgument (cannot be read)
  [[nodiscard]] Result<TileInput> load(std::size_t tile, std::uint32_t rings, std::uint32_t neighbors,
                                       float least_ring, bool has_normals,
                                       const std::optional<Box3f>& scan = std::nullopt) const;

  /// The records of the tile's own samples, in the scan's order. Pre: sorted with records, so long each
  /// Errors: kInvalidArgument (cannot be read)
  [[nodiscard]] Result<std::vector<std::byte>> own_records(std::size_t tile, std::size_t record_bytes) const;

  /// Of the files: those of another layout are another job's.
  static constexpr std::uint64_t kLayout = 2;

  /// Of one step of an animation; a plain job has step 0 alone.
  [[nodiscard]] bool has_result(std::size_t tile, std::size_t step) const;
  /// On the disk once it returns. Errors: those of write_file_atomically
  Result<void> put_result(std::size_t tile, std::size_t step, const TileResult& result) const;
  [[nodiscard]] std::string result_path(std::size_t tile, std::size_t step) const;

 private:
  struct Extent {
    std::uint64_t first = 0;  // in the spool, in samples
    std::uint64_t count = 0;
  };
  [[nodiscard]] std::uint64_t cell_samples(std::size_t cell) const;
  /// What a spool has of all samples of the cell, so many bytes each, to `to`. False: errno says why.
  bool read_cell(int spool, std::size_t cell, std::byte* to, std::size_t each) const;
  /// The tile's samples, then those of other tiles in the box that `widened` makes of the first ones; without
  /// one the tile's alone.
  Result<std::vector<TileSample>> read_around(
      std::size_t tile,
      const std::function<std::optional<Box3f>(std::span<const TileSample>)>& widened) const;
  [[nodiscard]] std::vector<std::byte> index_bytes() const;
  bool read_index();

  std::string folder_;
  TileCuts cuts_;
  Vec3d origin_;
  std::vector<std::vector<Extent>> extents_;  // of each cell
};

/// A tile's result as its file has it; views, valid while the bytes are.
struct TileResultView {
  std::span<const TileSample> moved;
  std::span<const std::uint64_t> removed;
  std::span<const std::uint64_t> roots;
  std::span<const std::uint64_t> counts;
  std::span<const PreviewMatch> matches;
  std::span<const std::byte> records;
};
/// Error: kMalformedData
Result<TileResultView> view_result(std::span<const std::byte> bytes);

}  // namespace pointwright::server

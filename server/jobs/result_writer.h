#pragma once
// The result of tiles: the scan's own bytes, record by record, with what moved put in, without what was
// collected, and what was inserted behind them.

#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "engine/core/execution_context.h"
#include "protocol/json/problem.h"
#include "server/jobs/mapped_file.h"
#include "server/jobs/result_head.h"
#include "server/jobs/scan_records.h"
#include "server/jobs/team.h"
#include "server/jobs/tile_store.h"

namespace pointwright::server {

/// A tile's result on the disk.
struct MadeTile {
  MappedFile file;
  TileResultView result;
};

/// Done by all of a team.
class ResultWriter {
 public:
  /// `origin`:   what the positions of moved samples are relative to
  /// `progress`: gets the part that is done
  ResultWriter(const MappedFile& file, const ScanRecords& records, Team& team, const Vec3d& origin,
               const ExecutionContext& context, std::function<void(double)> progress)
      : file_(file),
        records_(records),
        team_(team),
        origin_(origin),
        context_(context),
        progress_(std::move(progress)) {}

  /// The leader makes the file and gives it its name in the end; each of the team writes its chunks. Samples
  /// keep the scan's order; inserted ones follow all of them, in the order of those that they descend from. A
  /// LAS file's header gets the bounds of the samples as they are then, and where their number has changed
  /// that of each return; without a change it stays.
  /// Problems: a place that the file's whole numbers cannot say, more samples than its header can say, those
  ///           of writing, cancelled
  std::optional<protocol::Problem> write(const std::string& output, const std::vector<MadeTile>& tiles);

 private:
  struct ModelBox {
    Vec3d min = Vec3d::Constant(std::numeric_limits<double>::max());
    Vec3d max = Vec3d::Constant(std::numeric_limits<double>::lowest());
    void join(const ModelBox& other) {
      min = min.cwiseMin(other.min);
      max = max.cwiseMax(other.max);
    }
  };

  /// What a header says of records, of those that this process writes.
  struct Contents {
    ModelBox reach;
    ReturnCounts returns{};
    void join(const Contents& other);
  };
  /// Samples of the scan that are made and written together.
  struct Chunk {
    std::uint64_t begin = 0;
    std::uint64_t end = 0;
    std::uint64_t removed_before = 0;  // of the scan's
    std::uint64_t inserted_before = 0;
    bool loses = false;  // some of it
  };

  Result<void> write_share(const std::string& path);
  /// False: errno says why.
  Result<bool> write_records(SharedFile& out);
  void cut_into_chunks();
  /// The chunk's own records as they are now, without those that were collected. False: one cannot say its
  /// place.
  bool make(const Chunk& chunk, std::vector<std::byte>& bytes) const;
  void drop_removed(const Chunk& chunk, std::vector<std::byte>& bytes) const;
  /// Those that descend from the chunk's. False: errno says why.
  bool write_inserted(SharedFile& out, std::size_t chunk, Contents& contents) const;
  [[nodiscard]] Contents contents_of(std::span<const std::byte> chunk) const;
  /// False: errno says why.
  bool write_head(SharedFile& out, const Contents& mine);
  /// Puts the tile's samples begin .. end - 1 into the chunk. False: a record cannot say the place.
  bool replace(const MadeTile& tile, std::uint64_t begin, std::uint64_t end, std::byte* chunk) const;
  /// False: the record cannot say the place.
  bool replace(const TileSample& sample, std::byte* record) const;

  const MappedFile& file_;
  const ScanRecords& records_;
  Team& team_;
  const Vec3d origin_;
  const ExecutionContext& context_;
  const std::function<void(double)> progress_;
  // Of the result that is being written.
  std::span<const MadeTile> tiles_;
  std::vector<Chunk> chunks_;
  std::uint64_t removed_ = 0;
  std::uint64_t inserted_ = 0;
  std::vector<std::byte> head_;
  bool has_contents_ = false;  // in its header
};

}  // namespace pointwright::server

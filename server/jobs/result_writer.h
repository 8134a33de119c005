#pragma once
// The result of tiles: the scan's own bytes, record by record, with what moved put in.

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
#include "server/jobs/scan_records.h"
#include "server/jobs/team.h"
#include "server/jobs/tile_store.h"

namespace pointwright::server {

/// A tile's result on the disk.
struct MovedSamples {
  MappedFile file;
  std::span<const TileSample> samples;  ///< by index
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

  /// The leader makes the file and gives it its name in the end; each of the team writes its chunks. A LAS
  /// file's header gets the bounds of the samples as they are then; without a moved one it stays.
  /// Problems: a place that the file's whole numbers cannot say, those of writing, cancelled
  std::optional<protocol::Problem> write(const std::string& output, const std::vector<MovedSamples>& moved);

 private:
  struct ModelBox {
    Vec3d min = Vec3d::Constant(std::numeric_limits<double>::max());
    Vec3d max = Vec3d::Constant(std::numeric_limits<double>::lowest());
    void join(const ModelBox& other) {
      min = min.cwiseMin(other.min);
      max = max.cwiseMax(other.max);
    }
  };

  Result<void> write_share(const std::string& path, const std::vector<MovedSamples>& moved);
  /// False: errno says why.
  Result<bool> write_records(SharedFile& out, const std::vector<MovedSamples>& moved);
  [[nodiscard]] ModelBox reach_of(std::span<const std::byte> chunk) const;
  /// False: errno says why.
  bool write_bounds(SharedFile& out, const ModelBox& mine);
  /// Puts the tile's samples begin .. end - 1 into the chunk. False: a record cannot say the place.
  bool replace(const MovedSamples& moved, std::uint64_t begin, std::uint64_t end, std::byte* chunk) const;
  /// False: the record cannot say the place.
  bool replace(const TileSample& sample, std::byte* record) const;

  const MappedFile& file_;
  const ScanRecords& records_;
  Team& team_;
  const Vec3d origin_;
  const ExecutionContext& context_;
  const std::function<void(double)> progress_;
};

}  // namespace pointwright::server

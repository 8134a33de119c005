#pragma once

// The tiles of a job: from records to records, in bounded memory.

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "server/jobs/full_resolution.h"
#include "server/jobs/mapped_file.h"
#include "server/jobs/scan_records.h"
#include "server/jobs/team.h"

namespace pointwright::server {

/// What tiles are made of, and where what they give goes.
struct TiledScan {
  const MappedFile& file;
  const ScanRecords& records;
  std::vector<std::string> outputs;   ///< one for each cloud, as records
  bool is_packed_afterwards = false;  ///< each of them, into the output of the job
};
struct TiledResult {
  JobReport report;
  std::vector<bool> is_changed;  ///< by cloud: anything at all
};
/// JobMode::kTiles, in a folder that is the job's, where its files stay. Done by all of the team.
Outcome<TiledResult> run_tiles(const JobParams& params, const TiledScan& scan, Team& team,
                               const ExecutionContext& context, const JobProgress& progress);

/// Root mean square and greatest of what came apart, into the report.
class DifferenceSum {
 public:
  void add(double difference);
  void report(JobReport& report) const;

 private:
  std::uint64_t count_ = 0;
  double squares_ = 0.0;
  double greatest_ = 0.0;
};

/// Whether the preview can be of a scan between these corners. Problem: it stands elsewhere altogether
std::optional<protocol::Problem> check_preview(const Cloud& preview, const Vec3d& min, const Vec3d& max);

/// `count` evenly spaced samples of the cloud; the cloud itself where it has no more. Errors: kCancelled
Result<std::shared_ptr<const Cloud>> preview_of(const Cloud& cloud, std::uint64_t count,
                                                const ExecutionContext& context);

}  // namespace pointwright::server

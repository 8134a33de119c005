#pragma once
// The first pass over a scan: is it sound, how large is it, and some of its samples, by chance.

#include <cstdint>
#include <memory>
#include <vector>

#include "engine/core/cloud.h"
#include "engine/core/execution_context.h"
#include "engine/core/result.h"
#include "server/jobs/mapped_file.h"
#include "server/jobs/scan_records.h"
#include "server/jobs/team.h"

namespace pointwright::server {

struct ScanSurvey {
  Vec3d min = Vec3d::Zero();
  Vec3d max = Vec3d::Zero();
  std::uint64_t digest = 0;  ///< of every sample's position and normal, and of their order
  /// About as many samples as were asked for, all alike likely, in the file's order.
  std::vector<std::uint64_t> chosen;
  std::vector<Vec3d> position;  ///< of the chosen ones
  std::vector<Vec3f> normal;    ///< of the chosen ones, where the file has normals
};

/// Done by all of the team, who get the same.
/// Errors:      kNonFinite and kOutOfRange with the first such sample; kCancelled
/// Cost:        one pass, parallel; memory for the chosen ones alone
/// Determinism: which samples are chosen depends on their numbers alone
Result<ScanSurvey> survey(const MappedFile& file, const ScanRecords& records, std::uint64_t wanted,
                          Team& team, const ExecutionContext& context);

/// The chosen samples as a cloud in coherent order, about the origin that suits the whole scan; ids are
/// places in `chosen`.
Cloud chosen_cloud(const ScanSurvey& survey);

}  // namespace pointwright::server

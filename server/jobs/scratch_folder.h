#pragma once
// The folder of a job's scratch files: its own as long as it works there.

#include <filesystem>
#include <optional>
#include <string>

#include "protocol/json/problem.h"
#include "server/base/descriptor.h"
#include "server/jobs/team.h"

namespace pointwright::server {

class ScratchFolder {
 public:
  /// Done by all of a team, whose leader holds it. Made where it is not there.
  /// What an interrupted job does not go on from is deleted: results that were being written or packed.
  /// Problems: it cannot be made; another job works in it
  std::optional<protocol::Problem> take(const std::string& path, Team& team);
  /// Deletes what jobs have written into it, and the folder itself unless there is something of others in it.
  void remove() const;
  /// Deletes an unpacked scan, and the folder itself where it is empty then.
  void drop_scan() const;

  /// Where a scan is unpacked to, and results that are to be packed; of an animation with their numbers. No
  /// names that a folder of somebody's scans would hold.
  static constexpr const char* kScanName = "scan.unpacked";
  static constexpr const char* kEditedName = "edited.unpacked";
  static constexpr const char* kPackedFolder = "tiles.packed";  ///< pack_result()'s

  /// Whether a job writes files of that name into its folder.
  [[nodiscard]] static bool is_ours(const std::filesystem::path& path);
  /// Deletes all that is ours in the folder, what says that it is whole first.
  static void clear(const std::string& path);

 private:
  std::optional<protocol::Problem> lock();
  void clear_unfinished() const;
  static void clear_packed(const std::string& path);

  std::string path_;
  Descriptor lock_;  // the leader's
};

}  // namespace pointwright::server

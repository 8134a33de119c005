#pragma once
// The folder on disk that outlives the process: one daemon at a time, a version, and what lives where.

#include <cstddef>
#include <span>
#include <string>

#include "engine/core/result.h"
#include "server/ingest/child_process.h"

namespace pointwright::server {

/// Locked as long as it lives; the lock goes with the process, however that ends. Immutable, thread-safe.
class DataFolder {
 public:
  /// What this program writes into a folder, and the newest that it reads.
  static constexpr int kVersion = 1;

  /// Takes `path`, made where it is missing (readable by its owner alone). Empty: a private folder of this
  /// process below $TMPDIR, removed at the end.
  /// Throws std::runtime_error with a sentence: another process has it, a newer program wrote it, it holds
  /// other things, or the system refuses.
  explicit DataFolder(const std::string& path);
  ~DataFolder();
  DataFolder(const DataFolder&) = delete;
  DataFolder& operator=(const DataFolder&) = delete;

  /// Whether its content is there for the next process.
  [[nodiscard]] bool lasts() const { return lasts_; }
  [[nodiscard]] const std::string& path() const { return path_; }
  /// Content by its hash, never changed.
  [[nodiscard]] std::string blobs() const { return path_ + "/blobs"; }
  /// What is still arriving.
  [[nodiscard]] std::string uploads() const { return path_ + "/uploads"; }
  /// A folder for each job.
  [[nodiscard]] std::string jobs() const { return path_ + "/jobs"; }
  /// What was found damaged, kept for whoever looks into it.
  [[nodiscard]] std::string quarantine() const { return path_ + "/quarantine"; }
  [[nodiscard]] std::string database() const { return path_ + "/pointwright.db"; }

 private:
  void take();

  std::string path_;
  bool lasts_ = true;
  Descriptor lock_;
};

}  // namespace pointwright::server

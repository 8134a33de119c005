#pragma once
// Resumable uploads: bytes on disk, never in memory, that survive the client's connection and the daemon.

#include <sys/types.h>

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "server/base/outcome.h"
#include "server/base/sha256.h"
#include "server/config/limits.h"
#include "server/http/message.h"
#include "server/ingest/child_process.h"
#include "server/store/upload_file.h"

namespace pointwright::server {

/// An upload as it stands.
struct UploadStatus {
  UploadRecord record;
  std::uint64_t offset = 0;  ///< bytes that are on the disk
  std::chrono::system_clock::time_point expires;
};

/// The name that a job's folder has for what the job reads: a link to an upload, or to a cloud's file.
inline constexpr const char* kJobInputName = "input";

/// What Upload-Checksum names: the algorithm, and the digest in bytes.
struct UploadChecksum {
  Digest::Algorithm algorithm = Digest::Algorithm::kSha256;
  std::string digest;
};

/// Thread-safe. Files of a folder of their own; what it finds there at the start goes on.
class UploadStore {
  struct Entry;

 public:
  /// Removes what is expired or damaged, now and from time to time.
  /// `jobs`: a folder whose folders may have links to uploads; empty: there is none
  UploadStore(const Limits& limits, std::string folder, std::string jobs = {});
  ~UploadStore();
  UploadStore(const UploadStore&) = delete;
  UploadStore& operator=(const UploadStore&) = delete;

  /// The one request that writes to an upload now; the bytes of its body go through it to the file.
  class Writer final : public BodyTarget {
   public:
    ~Writer() override;
    Writer(const Writer&) = delete;
    Writer& operator=(const Writer&) = delete;
    bool write(std::span<const std::byte> bytes) override;
    [[nodiscard]] protocol::Problem problem() const override { return problem_; }
    /// The body is complete: checks its checksum, brings it to the disk. Afterwards the offset counts.
    /// Problems: checksum mismatch, out of space
    Outcome<UploadStatus> finish();
    /// The upload was made for this body: it goes with it where it is not finished.
    void begins_upload() { is_new_ = true; }

   private:
    friend class UploadStore;
    Writer(UploadStore& store, std::shared_ptr<Entry> entry, std::optional<UploadChecksum> checksum);
    bool open();
    void settle(bool keep);

    UploadStore& store_;
    std::shared_ptr<Entry> entry_;
    std::optional<UploadChecksum> checksum_;
    Digest digest_;
    Descriptor file_;
    std::uint64_t begin_;
    std::uint64_t at_;
    bool settled_ = false;
    bool is_new_ = false;
    bool is_finished_ = false;
    protocol::Problem problem_;
  };

  /// A new upload. `record`: all but id and time.
  /// Problems: too many, too large, out of space (with the bytes that are free)
  Outcome<UploadStatus> create(UploadRecord record);
  /// A writer of `length` bytes from `offset` on.
  /// Problems: not found, locked, offset mismatch, too large
  Outcome<std::shared_ptr<Writer>> write(const std::string& id, std::uint64_t offset, std::uint64_t length,
                                         std::optional<UploadChecksum> checksum);
  [[nodiscard]] std::optional<UploadStatus> find(const std::string& id) const;
  [[nodiscard]] std::vector<UploadStatus> list() const;  ///< oldest first
  /// Problems: not found, locked
  Outcome<Done> remove(const std::string& id);

  /// A complete upload's file while it is imported: nobody writes or removes it meanwhile.
  class Lease {
   public:
    Lease(std::shared_ptr<Entry> entry, UploadRecord record, Descriptor file);
    ~Lease();
    Lease(const Lease&) = delete;
    Lease& operator=(const Lease&) = delete;
    [[nodiscard]] const UploadRecord& record() const { return record_; }
    [[nodiscard]] int file() const { return file_.get(); }

   private:
    std::shared_ptr<Entry> entry_;
    UploadRecord record_;
    Descriptor file_;
  };
  /// Problems: not found, locked, wrong state (bytes are owed), internal error (the file cannot be opened)
  Outcome<std::shared_ptr<Lease>> lease(const std::string& id);

 private:
  [[nodiscard]] UploadStatus status_of(const Entry& entry) const;
  [[nodiscard]] std::shared_ptr<Entry> find_locked(const std::string& id) const;
  void load();
  bool load_one(const std::string& id);
  void remove_files(const std::string& id) const;
  void sweep();
  void sweep_until_stopped();
  [[nodiscard]] std::optional<protocol::Problem> check_room_locked(const UploadRecord& record) const;

  const Limits limits_;
  const std::string folder_;
  std::map<ino_t, nlink_t> job_links_;  // of uploads that jobs read, while they are loaded
  mutable std::mutex mutex_;            // guards all below and the entries
  std::condition_variable stopping_changed_;
  bool stopping_ = false;
  std::map<std::string, std::shared_ptr<Entry>> entries_;
  std::thread sweeper_;
};

}  // namespace pointwright::server

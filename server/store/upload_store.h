#pragma once
// Resumable uploads: bytes on disk, never in memory, that survive the client's connection and the daemon.

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <functional>
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
  /// Whether the open file, which has another name as well, is a cloud's that is kept.
  using IsImported = std::function<bool(int file)>;

  /// Removes what is expired, damaged or imported, now and from time to time.
  UploadStore(const Limits& limits, std::string folder, const IsImported& is_imported);
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
    /// Problems: checksum mismatch, out of space, storage failed
    Outcome<UploadStatus> finish();
    /// The upload was made for this body: it goes with it where it is not finished.
    void begins_upload() { is_new_ = true; }

   private:
    friend class UploadStore;
    Writer(UploadStore& store, std::shared_ptr<Entry> entry, std::optional<UploadChecksum> checksum);
    bool open();
    /// False: the offset stays where it was, and problem_ says why.
    bool settle(bool keep);

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
  /// Problems: too many, too large, out of space (with the bytes that are free), overloaded (no descriptors);
  /// storage failed, from then on for every call that writes
  Outcome<UploadStatus> create(UploadRecord record);
  /// A writer of `length` bytes from `offset` on.
  /// Problems: not found, locked, offset mismatch, too large, and those of create()
  Outcome<std::shared_ptr<Writer>> write(const std::string& id, std::uint64_t offset, std::uint64_t length,
                                         std::optional<UploadChecksum> checksum);
  [[nodiscard]] std::optional<UploadStatus> find(const std::string& id) const;
  [[nodiscard]] std::vector<UploadStatus> list() const;  ///< oldest first
  /// It does not come back after a loss of power.
  /// Problems: not found, locked, storage failed (it is gone, but may come back)
  Outcome<Done> remove(const std::string& id);

  /// Whether the disk has failed: nothing is written any more.
  [[nodiscard]] bool has_failed() const { return failed_; }

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
  void load(const IsImported& is_imported);
  bool load_one(const std::string& id, const IsImported& is_imported);
  void remove_files(const std::string& id) const;
  void sweep();
  void sweep_until_stopped();
  /// What a client is told of a call on the files that failed with that errno.
  protocol::Problem problem_of(int number, std::uint64_t wanted);
  [[nodiscard]] std::optional<protocol::Problem> check_room_locked(const UploadRecord& record) const;

  const Limits limits_;
  const std::string folder_;
  std::atomic<bool> failed_ = false;
  mutable std::mutex mutex_;  // guards all below and the entries
  std::condition_variable stopping_changed_;
  bool stopping_ = false;
  std::map<std::string, std::shared_ptr<Entry>> entries_;
  std::thread sweeper_;
};

}  // namespace pointwright::server

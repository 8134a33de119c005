#pragma once
// Files by the SHA-256 of their content, never changed.

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <vector>

#include "server/base/outcome.h"
#include "server/ingest/child_process.h"
#include "server/store/data_folder.h"

namespace pointwright::server {

/// What a blob is made of: bytes in memory, or a whole file of the data folder that is on the disk already.
struct BlobContent {
  std::span<const std::byte> bytes;
  int file = -1;  ///< a descriptor; -1: `bytes` are the content
  std::uint64_t size = 0;

  // NOLINTNEXTLINE(google-explicit-constructor)
  BlobContent(std::span<const std::byte> content) : bytes(content), size(content.size()) {}
  BlobContent(int whole_file, std::uint64_t length) : file(whole_file), size(length) {}
};

/// Thread-safe.
class BlobStore {
 public:
  explicit BlobStore(const DataFolder& folder) : folder_(folder) {}

  /// Whether anything still refers to a blob: asked with nothing of it being stored meanwhile.
  using IsUsed = std::function<bool(const std::string& sha256)>;

  /// The content is on the disk, and stays as long as the returned pin lives, used or not.
  /// Problems: kOutOfDisk; kStorageFailed, from then on for every call
  Outcome<std::shared_ptr<const void>> put(const std::string& sha256, const BlobContent& content);
  /// An open blob: a descriptor and how many bytes.
  struct Open {
    Descriptor file;
    std::uint64_t size = 0;
  };
  /// What was put, to be read piece by piece. What is not that any more goes to quarantine.
  /// Problems: kDamaged; kOverloaded (it cannot be opened now)
  Outcome<std::shared_ptr<const Open>> open(const std::string& sha256) const;
  /// The same, read whole.
  Outcome<std::vector<std::byte>> read(const std::string& sha256) const;
  /// The hash under which the open file is stored; empty where it is not. Cost: looks at every blob.
  [[nodiscard]] std::string name_of(int file) const;
  /// Deletes the blob unless it is pinned or used.
  void drop(const std::string& sha256, const IsUsed& is_used);
  /// Deletes everything else than blobs that are used. Pre: nothing is being stored.
  void sweep(const IsUsed& is_used);
  [[nodiscard]] bool has_failed() const;

 private:
  /// A blob that nobody deletes as long as this lives.
  struct Pin {
    std::mutex turn;  // of whoever puts it there or aside
  };
  [[nodiscard]] std::string path_of(const std::string& sha256) const;
  [[nodiscard]] std::shared_ptr<Pin> pin_locked(const std::string& sha256) const;
  void fail();

  const DataFolder& folder_;
  mutable std::mutex mutex_;  // guards what follows; nobody writes a blob under it
  bool failed_ = false;
  mutable std::map<std::string, std::weak_ptr<Pin>> pins_;
};

}  // namespace pointwright::server

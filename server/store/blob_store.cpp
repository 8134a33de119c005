#include "server/store/blob_store.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>

#include "server/base/sha256.h"
#include "server/ingest/files.h"

namespace pointwright::server {

using protocol::Problem;
using protocol::ProblemKind;

std::string BlobStore::path_of(const std::string& sha256) const {
  return folder_.blobs() + "/" + sha256;
}

namespace {

/// How storing went.
enum class Stored { kDone, kFull, kFailed };

Stored outcome_of(const Result<void>& written) {
  if (written) return Stored::kDone;
  return written.error().code == ErrorCode::kTooLarge ? Stored::kFull : Stored::kFailed;
}

/// Gives the open file another name: nothing is copied, unless the folders cannot share files.
Stored link_file(const BlobContent& content, const std::string& folder, const std::string& path) {
  const std::string open_file = "/proc/self/fd/" + std::to_string(content.file);
  if (::linkat(AT_FDCWD, open_file.c_str(), AT_FDCWD, path.c_str(), AT_SYMLINK_FOLLOW) == 0)
    return sync_folder(folder) ? Stored::kDone : Stored::kFailed;
  return outcome_of(copy_file_atomically(path, content.file, content.size));
}

/// Whether the file is what its name says.
bool has_hash(int file, std::uint64_t size, const std::string& sha256) {
  Digest digest(Digest::Algorithm::kSha256);
  const auto add = [&](std::span<const std::byte> piece) {
    digest.add(piece);
    return true;
  };
  return read_pieces(file, size, add) && to_hex(digest.finish()) == sha256;
}
bool has_hash(const std::string& path, std::uint64_t size, const std::string& sha256) {
  const Descriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  return file.is_open() && has_hash(file.get(), size, sha256);
}

/// Whether the path is a name of the open file.
bool is_named(int file, const std::string& path) {
  struct stat opened {};
  struct stat named {};
  return ::fstat(file, &opened) == 0 && ::lstat(path.c_str(), &named) == 0 && opened.st_ino == named.st_ino &&
         opened.st_dev == named.st_dev;
}

}  // namespace

std::shared_ptr<BlobStore::Pin> BlobStore::pin_locked(const std::string& sha256) const {
  std::erase_if(pins_, [](const auto& entry) { return entry.second.expired(); });
  std::weak_ptr<Pin>& known = pins_[sha256];
  auto pin = known.lock();
  if (pin == nullptr) {
    pin = std::make_shared<Pin>();
    known = pin;
  }
  return pin;
}

void BlobStore::fail() {
  const std::lock_guard lock(mutex_);
  failed_ = true;
}

Outcome<std::shared_ptr<const void>> BlobStore::put(const std::string& sha256, const BlobContent& content) {
  const Problem failure{.kind = ProblemKind::kStorageFailed,
                        .detail = "the disk has failed: nothing can be stored"};
  std::shared_ptr<Pin> pin;
  {
    const std::lock_guard lock(mutex_);
    if (failed_) return failure;
    pin = pin_locked(sha256);
  }
  // Only those who store the same content wait for each other.
  const std::lock_guard turn(pin->turn);
  const std::string path = path_of(sha256);
  std::error_code none;
  if (std::filesystem::file_size(path, none) == content.size && !none &&
      has_hash(path, content.size, sha256)) {
    // Its name may not be on the disk yet: whoever gave it may have been stopped right then.
    if (sync_folder(folder_.blobs())) return std::shared_ptr<const void>(pin);
    fail();
    return failure;
  }
  std::filesystem::remove(path, none);  // damaged, where it is there
  const Stored stored = content.file < 0 ? outcome_of(write_file_atomically(path, content.bytes))
                                         : link_file(content, folder_.blobs(), path);
  if (stored == Stored::kFull)
    return Problem{.kind = ProblemKind::kOutOfDisk, .detail = "the disk is full; nothing was stored"};
  if (stored == Stored::kFailed) {
    fail();
    return failure;
  }
  return std::shared_ptr<const void>(pin);
}

Outcome<std::shared_ptr<const BlobStore::Open>> BlobStore::open(const std::string& sha256) const {
  const Problem damaged{.kind = ProblemKind::kDamaged,
                        .detail = "the stored file is missing or damaged: it is not served"};
  const std::string path = path_of(sha256);
  std::error_code none;
  auto blob = std::make_shared<Open>();
  blob->file = Descriptor(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW));
  if (!blob->file.is_open() && std::filesystem::exists(path, none))
    return Problem{.kind = ProblemKind::kOverloaded, .detail = "the stored file cannot be read now"};
  if (!blob->file.is_open()) return damaged;
  const auto size = std::filesystem::file_size(path, none);
  if (!none && has_hash(blob->file.get(), size, sha256)) {
    blob->size = size;
    return std::shared_ptr<const Open>(std::move(blob));
  }
  std::shared_ptr<Pin> pin;
  {
    const std::lock_guard lock(mutex_);
    pin = pin_locked(sha256);
  }
  const std::lock_guard turn(pin->turn);
  // What was read, and not what has been put in its place meanwhile.
  if (is_named(blob->file.get(), path))
    std::filesystem::rename(path, folder_.quarantine() + "/" + sha256, none);
  return damaged;
}

Outcome<std::vector<std::byte>> BlobStore::read(const std::string& sha256) const {
  const auto blob = open(sha256);
  if (!blob.ok()) return blob.problem();
  std::vector<std::byte> content;
  content.reserve(static_cast<std::size_t>(blob.value()->size));
  const bool is_read =
      read_pieces(blob.value()->file.get(), blob.value()->size, [&](std::span<const std::byte> piece) {
        content.insert(content.end(), piece.begin(), piece.end());
        return true;
      });
  if (is_read) return content;
  return Problem{.kind = ProblemKind::kOverloaded, .detail = "the stored file cannot be read now"};
}

std::string BlobStore::name_of(int file) const {
  std::error_code none;
  for (const auto& entry : std::filesystem::directory_iterator(folder_.blobs(), none))
    if (is_named(file, entry.path().string())) return entry.path().filename().string();
  return {};
}

void BlobStore::drop(const std::string& sha256, const IsUsed& is_used) {
  const std::lock_guard lock(mutex_);
  if (const auto pin = pins_.find(sha256); pin != pins_.end() && !pin->second.expired()) return;
  std::error_code none;  // what stays goes with the next sweep
  if (!is_used(sha256)) std::filesystem::remove(path_of(sha256), none);
}

void BlobStore::sweep(const IsUsed& is_used) {
  const std::lock_guard lock(mutex_);
  std::error_code none;
  std::vector<std::filesystem::path> unused;
  for (const auto& entry : std::filesystem::directory_iterator(folder_.blobs(), none))
    if (!is_used(entry.path().filename().string())) unused.push_back(entry.path());
  for (const auto& path : unused) std::filesystem::remove(path, none);
}

bool BlobStore::has_failed() const {
  const std::lock_guard lock(mutex_);
  return failed_;
}

}  // namespace pointwright::server

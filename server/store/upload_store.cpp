#include "server/store/upload_store.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <filesystem>

#include "server/base/random_id.h"
#include "server/ingest/files.h"

namespace pointwright::server {

using protocol::Problem;
using protocol::ProblemKind;
using std::chrono::system_clock;

namespace {

/// Of the disk: left to everything else.
constexpr std::uint64_t kReserve = 64ULL << 20U;

Problem not_found() {
  return {.kind = ProblemKind::kNotFound,
          .detail = "there is no such upload: it was imported, removed, or expired"};
}
Problem locked() {
  return {.kind = ProblemKind::kUploadLocked, .detail = "another request has the upload"};
}
Problem out_of_space(std::uint64_t free, std::uint64_t wanted) {
  return {.kind = ProblemKind::kOutOfSpace,
          .detail = "the disk has no room for the upload",
          .limit = static_cast<double>(free),
          .actual = static_cast<double>(wanted)};
}

Problem storage_failed() {
  return {.kind = ProblemKind::kStorageFailed,
          .detail = "the disk has failed: uploads wait until the operator has looked into it"};
}

std::uint64_t free_bytes(const std::string& folder) {
  struct statvfs info {};
  if (::statvfs(folder.c_str(), &info) != 0) return 0;
  const std::uint64_t free = static_cast<std::uint64_t>(info.f_bavail) * info.f_frsize;
  return free > kReserve ? free - kReserve : 0;
}

bool write_all(int file, std::span<const std::byte> bytes, std::uint64_t at) {
  while (!bytes.empty()) {
    const ssize_t written = ::pwrite(file, bytes.data(), bytes.size(), static_cast<off_t>(at));
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) return false;
    bytes = bytes.subspan(static_cast<std::size_t>(written));
    at += static_cast<std::uint64_t>(written);
  }
  return true;
}

Descriptor open_bytes(const std::string& path, int flags) {
  return Descriptor(::open(path.c_str(), flags | O_NOFOLLOW | O_CLOEXEC, 0600));
}

/// Removes the mark of an upload; it does not come back. False: errno says why it might.
bool drop_mark(const std::string& folder, const std::string& id) {
  const std::string path = upload_mark_path(folder, id);
  if (::unlink(path.c_str()) != 0) return errno == ENOENT;
  return sync_folder(folder);
}

/// An errno for what became of a file; 0: it is there.
int number_of(const Result<void>& written) {
  if (written) return 0;
  return written.error().code == ErrorCode::kTooLarge ? ENOSPC : EIO;
}

}  // namespace

struct UploadStore::Entry {
  UploadRecord record;
  std::uint64_t offset = 0;  // on the disk
  system_clock::time_point changed;
  std::mutex* mutex = nullptr;  // the store's
  bool is_held = false;         // by a writer or a lease
  bool is_gone = false;
};

// ---- the store ----

UploadStore::UploadStore(const Limits& limits, std::string folder, const IsImported& is_imported)
    : limits_(limits), folder_(std::move(folder)) {
  load(is_imported);
  sweep();
  sweeper_ = std::thread([this] { sweep_until_stopped(); });
}

UploadStore::~UploadStore() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  stopping_changed_.notify_all();
  sweeper_.join();
}

void UploadStore::load(const IsImported& is_imported) {
  std::vector<std::filesystem::path> stray;
  for (const auto& file : std::filesystem::directory_iterator(folder_)) {
    const std::string id = file.path().stem().string();
    const bool is_known = entries_.contains(id) || (protocol::is_valid_id(id) && load_one(id, is_imported));
    if (!is_known) stray.push_back(file.path());
  }
  // Bytes without a record, halves of records, and what nobody of us wrote.
  std::error_code ignored;
  for (const auto& path : stray) std::filesystem::remove(path, ignored);
}

bool UploadStore::load_one(const std::string& id, const IsImported& is_imported) {
  auto record = read_upload_record(folder_, id);
  const Descriptor file = open_bytes(upload_bytes_path(folder_, id), O_RDWR);
  struct stat info {};
  if (!record || !file.is_open() || ::fstat(file.get(), &info) != 0 || !S_ISREG(info.st_mode)) return false;
  const auto size = static_cast<std::uint64_t>(info.st_size);
  std::uint64_t offset = size;
  if (const auto mark = read_file(upload_mark_path(folder_, id), 32); mark) {
    // The last bytes were to be held against a checksum that never came to be.
    const std::string text(reinterpret_cast<const char*>(mark.value().data()), mark.value().size());
    offset = std::min<std::uint64_t>(offset, std::strtoull(text.c_str(), nullptr, 10));
  }
  offset = std::min(offset, record->length);
  // Another name is a cloud's: the import is done, or it was stopped before the cloud was there. Never cut.
  if (info.st_nlink > 1 && (offset != size || is_imported(file.get()))) return false;
  if (::ftruncate(file.get(), static_cast<off_t>(offset)) != 0) return false;
  // What the last process wrote may not have reached the disk; only then may it be told.
  if (::fdatasync(file.get()) != 0) return false;
  ::unlink(upload_mark_path(folder_, id).c_str());
  auto entry = std::make_shared<Entry>();
  entry->record = std::move(*record);
  entry->offset = offset;
  entry->changed = system_clock::from_time_t(info.st_mtime);
  entry->mutex = &mutex_;
  entries_.emplace(id, std::move(entry));
  return true;
}

void UploadStore::remove_files(const std::string& id) const {
  for (const std::string& path :
       {upload_record_path(folder_, id), upload_bytes_path(folder_, id), upload_mark_path(folder_, id)})
    ::unlink(path.c_str());
}

UploadStatus UploadStore::status_of(const Entry& entry) const {
  return {.record = entry.record,
          .offset = entry.offset,
          .expires = entry.changed + std::chrono::seconds(limits_.upload_expiry_s)};
}

std::shared_ptr<UploadStore::Entry> UploadStore::find_locked(const std::string& id) const {
  const auto found = entries_.find(id);
  if (found == entries_.end()) return nullptr;
  const bool expired = !found->second->is_held && status_of(*found->second).expires <= system_clock::now();
  return expired ? nullptr : found->second;
}

void UploadStore::sweep() {
  const std::lock_guard lock(mutex_);
  std::erase_if(entries_, [&](const auto& item) {
    const bool expired = !item.second->is_held && status_of(*item.second).expires <= system_clock::now();
    if (expired) remove_files(item.first);
    return expired;
  });
}

void UploadStore::sweep_until_stopped() {
  const auto pause = std::chrono::seconds(std::clamp<std::uint64_t>(limits_.upload_expiry_s / 2, 1, 60));
  std::unique_lock lock(mutex_);
  while (!stopping_changed_.wait_for(lock, pause, [&] { return stopping_; })) {
    lock.unlock();
    sweep();
    lock.lock();
  }
}

std::optional<Problem> UploadStore::check_room_locked(const UploadRecord& record) const {
  const std::uint64_t length = record.length;
  if (length > limits_.max_upload_file_bytes)
    return Problem{.kind = ProblemKind::kBodyTooLarge,
                   .detail = "the upload is larger than the server takes",
                   .limit = static_cast<double>(limits_.max_upload_file_bytes),
                   .actual = static_cast<double>(length)};
  if (entries_.size() >= limits_.max_uploads)
    return Problem{.kind = ProblemKind::kTooMany,
                   .detail = "the server holds as many uploads as it may",
                   .limit = static_cast<double>(limits_.max_uploads),
                   .actual = static_cast<double>(entries_.size())};
  if (!record.owner.empty()) {
    std::uint64_t count = 1;
    std::uint64_t bytes = length;
    for (const auto& item : entries_) {
      if (item.second->record.owner != record.owner) continue;
      ++count;
      bytes += item.second->record.length;
    }
    const auto over = [](const char* what, std::uint64_t limit, std::uint64_t actual) {
      return Problem{.kind = ProblemKind::kTooMany,
                     .detail = std::string("the token's resumable uploads would exceed ").append(what),
                     .limit = static_cast<double>(limit),
                     .actual = static_cast<double>(actual)};
    };
    if (count > limits_.token_uploads) return over("token_uploads", limits_.token_uploads, count);
    if (bytes > limits_.token_upload_file_bytes)
      return over("token_upload_file_bytes", limits_.token_upload_file_bytes, bytes);
  }
  // What others were promised is not free.
  std::uint64_t promised = 0;
  for (const auto& item : entries_) promised += item.second->record.length - item.second->offset;
  const std::uint64_t free = free_bytes(folder_);
  const std::uint64_t left = free > promised ? free - promised : 0;
  if (length > left) return out_of_space(left, length);
  return std::nullopt;
}

Problem UploadStore::problem_of(int number, std::uint64_t wanted) {
  if (number == ENOSPC || number == EDQUOT || number == EFBIG)
    return out_of_space(free_bytes(folder_), wanted);
  if (number == EMFILE || number == ENFILE || number == ENOMEM)
    return {.kind = ProblemKind::kOverloaded, .detail = "the upload's file cannot be opened now"};
  // What was handed to the disk and not taken may or may not be there: trying again would hide it.
  failed_ = true;
  return storage_failed();
}

Outcome<UploadStatus> UploadStore::create(UploadRecord record) {
  if (failed_) return storage_failed();
  sweep();
  record.id = random_id();
  record.created = system_clock::now();
  auto entry = std::make_shared<Entry>();
  entry->record = std::move(record);
  entry->changed = entry->record.created;
  entry->mutex = &mutex_;
  const std::string id = entry->record.id;
  {
    const std::lock_guard lock(mutex_);
    if (auto problem = check_room_locked(entry->record)) return *problem;
    entries_.emplace(id, entry);
  }
  const Descriptor file = open_bytes(upload_bytes_path(folder_, id), O_RDWR | O_CREAT | O_EXCL);
  int number = file.is_open() && ::fsync(file.get()) == 0 ? 0 : errno;
  if (number == 0) number = number_of(write_upload_record(folder_, entry->record));
  const std::lock_guard lock(mutex_);
  if (number == 0) return status_of(*entry);
  remove_files(id);
  entries_.erase(id);
  return problem_of(number, entry->record.length);
}

Outcome<std::shared_ptr<UploadStore::Writer>> UploadStore::write(const std::string& id, std::uint64_t offset,
                                                                 std::uint64_t length,
                                                                 std::optional<UploadChecksum> checksum) {
  std::shared_ptr<Entry> entry;
  {
    const std::lock_guard lock(mutex_);
    entry = find_locked(id);
    if (entry == nullptr) return not_found();
    if (failed_) return storage_failed();
    if (entry->is_held) return locked();
    if (offset != entry->offset)
      return Problem{.kind = ProblemKind::kUploadOffset,
                     .detail = "the server has " + std::to_string(entry->offset) + " bytes of the upload",
                     .limit = static_cast<double>(entry->offset),
                     .actual = static_cast<double>(offset)};
    if (length > entry->record.length - entry->offset)
      return Problem{.kind = ProblemKind::kBodyTooLarge,
                     .detail = "the body goes beyond the upload's length",
                     .limit = static_cast<double>(entry->record.length - entry->offset),
                     .actual = static_cast<double>(length)};
    entry->is_held = true;
  }
  std::shared_ptr<Writer> writer(new Writer(*this, std::move(entry), std::move(checksum)));
  if (!writer->open()) return writer->problem();
  return writer;
}

std::optional<UploadStatus> UploadStore::find(const std::string& id) const {
  const std::lock_guard lock(mutex_);
  const auto entry = find_locked(id);
  if (entry == nullptr) return std::nullopt;
  return status_of(*entry);
}

std::vector<UploadStatus> UploadStore::list() const {
  std::vector<UploadStatus> all;
  {
    const std::lock_guard lock(mutex_);
    for (const auto& item : entries_)
      if (find_locked(item.first) != nullptr) all.push_back(status_of(*item.second));
  }
  std::sort(all.begin(), all.end(), [](const UploadStatus& a, const UploadStatus& b) {
    return std::pair(a.record.created, a.record.id) < std::pair(b.record.created, b.record.id);
  });
  return all;
}

Outcome<Done> UploadStore::remove(const std::string& id) {
  {
    const std::lock_guard lock(mutex_);
    const auto entry = find_locked(id);
    if (entry == nullptr) return not_found();
    if (entry->is_held) return locked();
    entry->is_held = true;
  }
  remove_files(id);
  // Nobody waits for the disk under the lock.
  const int number = sync_folder(folder_) ? 0 : errno;
  const std::lock_guard lock(mutex_);
  entries_.erase(id);
  if (number != 0) return problem_of(number, 0);
  return Done{};
}

Outcome<std::shared_ptr<UploadStore::Lease>> UploadStore::lease(const std::string& id) {
  const std::lock_guard lock(mutex_);
  const auto entry = find_locked(id);
  if (entry == nullptr) return not_found();
  if (entry->is_held) return locked();
  if (entry->offset < entry->record.length)
    return Problem{.kind = ProblemKind::kWrongState,
                   .detail = "the upload is not complete",
                   .limit = static_cast<double>(entry->record.length),
                   .actual = static_cast<double>(entry->offset)};
  Descriptor file = open_bytes(upload_bytes_path(folder_, id), O_RDONLY);
  if (!file.is_open())
    return Problem{.kind = ProblemKind::kInternalError, .detail = "the upload cannot be opened"};
  entry->is_held = true;
  return std::make_shared<Lease>(entry, entry->record, std::move(file));
}

UploadStore::Lease::Lease(std::shared_ptr<Entry> entry, UploadRecord record, Descriptor file)
    : entry_(std::move(entry)), record_(std::move(record)), file_(std::move(file)) {}

UploadStore::Lease::~Lease() {
  const std::lock_guard lock(*entry_->mutex);
  entry_->is_held = false;
}

// ---- one body ----

UploadStore::Writer::Writer(UploadStore& store, std::shared_ptr<Entry> entry,
                            std::optional<UploadChecksum> checksum)
    : store_(store),
      entry_(std::move(entry)),
      checksum_(std::move(checksum)),
      digest_(checksum_ ? checksum_->algorithm : Digest::Algorithm::kSha256),
      begin_(entry_->offset),
      at_(begin_) {}

UploadStore::Writer::~Writer() {
  if (!settled_) settle(!checksum_);
  // Nobody was told of it.
  if (is_new_ && !is_finished_) static_cast<void>(store_.remove(entry_->record.id).ok());
}

bool UploadStore::Writer::open() {
  const std::string& id = entry_->record.id;
  file_ = open_bytes(upload_bytes_path(store_.folder_, id), O_RDWR);
  int number = file_.is_open() ? 0 : errno;
  if (number == 0 && checksum_) {
    const std::string text = std::to_string(begin_);
    number = number_of(write_file_atomically(upload_mark_path(store_.folder_, id),
                                             std::as_bytes(std::span(text.data(), text.size()))));
  } else if (number == 0 && !drop_mark(store_.folder_, id)) {
    number = errno;  // the mark is of a body before that could not be settled
  }
  if (number != 0) problem_ = store_.problem_of(number, 1);
  return number == 0;
}

bool UploadStore::Writer::write(std::span<const std::byte> bytes) {
  if (checksum_) digest_.add(bytes);
  if (!write_all(file_.get(), bytes, at_)) {
    problem_ = store_.problem_of(errno, entry_->record.length - at_);
    return false;
  }
  at_ += bytes.size();
  return true;
}

// Keeps what came, or goes back to where the body began; either way to the disk, and the offset with it.
bool UploadStore::Writer::settle(bool keep) {
  settled_ = true;
  const std::uint64_t offset = keep ? at_ : begin_;
  bool is_safe = file_.is_open();
  // A write that failed half-way left bytes beyond what counts.
  is_safe = is_safe && ::ftruncate(file_.get(), static_cast<off_t>(offset)) == 0;
  is_safe = is_safe && ::fdatasync(file_.get()) == 0;
  // Came the mark back after a loss of power, what is told now would be cut off again.
  if (is_safe && checksum_) is_safe = drop_mark(store_.folder_, entry_->record.id);
  if (!is_safe && file_.is_open()) problem_ = store_.problem_of(errno, entry_->record.length - begin_);
  const std::lock_guard lock(*entry_->mutex);
  if (is_safe) {
    entry_->offset = offset;
    entry_->changed = system_clock::now();
  }
  entry_->is_held = false;
  return is_safe;
}

Outcome<UploadStatus> UploadStore::Writer::finish() {
  if (checksum_ && digest_.finish() != checksum_->digest) {
    if (!settle(false)) return problem_;
    return Problem{.kind = ProblemKind::kChecksumMismatch,
                   .detail = "the bytes do not have that checksum; the upload stands where it stood"};
  }
  if (!settle(true)) return problem_;
  const std::lock_guard lock(*entry_->mutex);
  is_finished_ = true;
  return store_.status_of(*entry_);
}

}  // namespace pointwright::server

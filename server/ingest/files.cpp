#include "server/ingest/files.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <charconv>
#include <csignal>
#include <filesystem>
#include <string_view>
#include <system_error>
#include <vector>

#include "server/base/descriptor.h"

namespace pointwright {
namespace {

Error path_too_large(const std::string& path, std::uint64_t limit, std::uint64_t actual) {
  return Error{.code = ErrorCode::kTooLarge,
               .message = path + " is larger than " + std::to_string(limit) + " bytes",
               .field = "path",
               .limit = static_cast<double>(limit),
               .actual = static_cast<double>(actual)};
}

std::string folder_of(const std::string& path) {
  const std::size_t slash = path.rfind('/');
  if (slash == std::string::npos) return ".";
  return slash == 0 ? "/" : path.substr(0, slash);
}

// A name that no other writer, in this process or another, uses at the same time.
constexpr std::string_view kTemporary = ".new-";  // then the process and a number

std::string temporary_name(const std::string& path) {
  static std::atomic<unsigned> counter{0};
  return std::string(path).append(kTemporary) + std::to_string(getpid()) + "-" +
         std::to_string(counter.fetch_add(1));
}

}  // namespace

Error file_error(const char* what, const std::string& path, int number) {
  const bool is_full = number == ENOSPC || number == EDQUOT || number == EFBIG;
  return Error{.code = is_full ? ErrorCode::kTooLarge : ErrorCode::kInvalidArgument,
               .message = std::string(what) + " " + path + ": " + std::system_category().message(number),
               .field = "path"};
}

Result<std::vector<std::byte>> read_file(const std::string& path, std::uint64_t max_bytes) {
  // Not waiting: a pipe in the place of a file must not hold who asked.
  const Descriptor file(open(path.c_str(), O_RDONLY | O_NONBLOCK | O_NOCTTY | O_CLOEXEC));
  struct stat info {};
  if (!file.is_open() || fstat(file.get(), &info) != 0) return file_error("cannot open", path, errno);
  if (!S_ISREG(info.st_mode)) return file_error("cannot read", path, S_ISDIR(info.st_mode) ? EISDIR : EINVAL);
  const auto size = static_cast<std::uint64_t>(info.st_size);
  if (size > max_bytes) return path_too_large(path, max_bytes, size);
  std::vector<std::byte> bytes(size);
  std::size_t at = 0;
  while (at < bytes.size()) {
    const ssize_t got = read(file.get(), bytes.data() + at, bytes.size() - at);
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) return file_error("cannot read", path, errno);
    if (got == 0) break;  // cut short under our hands
    at += static_cast<std::size_t>(got);
  }
  bytes.resize(at);
  return bytes;
}

Result<void> fill_file_atomically(const std::string& path, const std::function<Result<bool>(int)>& fill) {
  const Descriptor folder(open(folder_of(path).c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (!folder.is_open()) return file_error("cannot open the folder of", path, errno);
  const std::string temporary = temporary_name(path);
  {
    Descriptor file(open(temporary.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0600));
    if (!file.is_open()) return file_error("cannot create", temporary, errno);
    static_cast<void>(flock(file.get(), LOCK_EX | LOCK_NB));  // nobody takes it for a leftover
    const Result<bool> filled = fill(file.get());
    const bool is_written = filled && filled.value() && fsync(file.get()) == 0;
    if (!is_written || rename(temporary.c_str(), path.c_str()) != 0) {
      const int number = errno;
      unlink(temporary.c_str());
      return filled ? file_error("cannot write", path, number) : filled.error();
    }
  }
  if (fsync(folder.get()) != 0) return file_error("cannot sync the folder of", path, errno);
  return {};
}

Result<void> write_file_atomically(const std::string& path, std::span<const std::byte> bytes) {
  return fill_file_atomically(path, [&](int file) { return write_all(file, bytes); });
}

Result<void> copy_file_atomically(const std::string& path, int file, std::uint64_t size) {
  return fill_file_atomically(path, [&](int copy) {
    return read_pieces(file, size,
                       [copy](std::span<const std::byte> piece) { return write_all(copy, piece); });
  });
}

namespace {

/// "PROCESS-NUMBER" of temporary_name(), of a process that is no more.
bool is_leftover(std::string_view text) {
  pid_t writer = 0;
  unsigned number = 0;
  const char* const end = text.data() + text.size();
  const auto [dash, error] = std::from_chars(text.data(), end, writer);
  if (error != std::errc() || writer <= 0 || dash == end || *dash != '-') return false;
  const auto [last, wrong] = std::from_chars(dash + 1, end, number);
  return wrong == std::errc() && last == end && kill(writer, 0) != 0 && errno == ESRCH;
}

/// Whether it is no regular file, or somebody writes it: on another machine, perhaps.
bool is_held(const std::string& path) {
  const Descriptor file(open(path.c_str(), O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC));
  struct stat info {};
  return !file.is_open() || fstat(file.get(), &info) != 0 || !S_ISREG(info.st_mode) ||
         flock(file.get(), LOCK_EX | LOCK_NB) != 0;
}

}  // namespace

void remove_leftovers(const std::string& path) {
  const std::string start = std::filesystem::path(path).filename().string().append(kTemporary);
  std::vector<std::filesystem::path> left;
  std::error_code none;
  for (const auto& entry : std::filesystem::directory_iterator(folder_of(path), none)) {
    const std::string name = entry.path().filename().string();
    if (!name.starts_with(start)) continue;
    if (is_leftover(name.substr(start.size())) && !is_held(entry.path().string()))
      left.push_back(entry.path());
  }
  for (const auto& each : left) std::filesystem::remove(each, none);
}

bool read_pieces(int file, std::uint64_t size, const std::function<bool(std::span<const std::byte>)>& take) {
  constexpr std::uint64_t kPieceBytes = std::uint64_t{1} << 20U;
  std::vector<std::byte> piece(static_cast<std::size_t>(std::min(size, kPieceBytes)));
  for (std::uint64_t at = 0; at < size;) {
    const auto want = static_cast<std::size_t>(std::min<std::uint64_t>(size - at, piece.size()));
    const ssize_t got = pread(file, piece.data(), want, static_cast<off_t>(at));
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0 || !take(std::span(piece).first(static_cast<std::size_t>(got)))) return false;
    at += static_cast<std::uint64_t>(got);
  }
  return true;
}

bool write_all(int file, std::span<const std::byte> bytes) {
  while (!bytes.empty()) {
    const ssize_t written = write(file, bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written == 0) errno = EIO;
    if (written <= 0) return false;
    bytes = bytes.subspan(static_cast<std::size_t>(written));
  }
  return true;
}

bool write_all_at(int file, std::span<const std::byte> bytes, std::uint64_t offset) {
  while (!bytes.empty()) {
    const ssize_t written = pwrite(file, bytes.data(), bytes.size(), static_cast<off_t>(offset));
    if (written < 0 && errno == EINTR) continue;
    if (written == 0) errno = EIO;
    if (written <= 0) return false;
    bytes = bytes.subspan(static_cast<std::size_t>(written));
    offset += static_cast<std::uint64_t>(written);
  }
  return true;
}

bool sync_folder(const std::string& path) {
  const Descriptor folder(open(path.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  return folder.is_open() && fsync(folder.get()) == 0;
}

}  // namespace pointwright

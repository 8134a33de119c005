// A disk that fails on demand, preloaded into the real daemon by tests: power that goes at the k-th fsync,
// syncs and writes that fail, space that ends. It stands between the daemon and the calls by which the
// daemon and SQLite write.
//
// What is durable: of a file, its bytes at its last fsync or fdatasync; of a folder, its names at its last
// fsync. They are kept in `durable` as files/<inode> and names/<path, with % for />, a line "<inode> <d or
// f> <name>" each. The real files go on as if nothing had happened: they are the page cache.

#include <dirent.h>
#include <fcntl.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <mutex>
#include <set>
#include <string>

#include "tests/support/faulty_disk_page.h"

namespace {

using pointwright::test::FaultyDiskPage;

FaultyDiskPage* page = nullptr;
std::mutex turn;  // of the disk: it does one thing at a time

[[gnu::constructor]] void begin() {
  const char* const name = std::getenv(pointwright::test::kFaultyDiskVariable);
  if (name == nullptr) return;
  const int file = ::open(name, O_RDWR | O_CLOEXEC);
  void* const memory = ::mmap(nullptr, sizeof(FaultyDiskPage), PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
  ::close(file);
  if (memory == MAP_FAILED) std::abort();  // a test that tests nothing
  page = static_cast<FaultyDiskPage*>(memory);
  // The daemon's children have disks that do not fail.
  ::unsetenv("LD_PRELOAD");
}

/// Where an open file lies below the data folder, "" for that folder itself; false: elsewhere.
bool find_below(int file, std::string& path) {
  if (page == nullptr) return false;
  std::array<char, 1024> target{};
  const std::string link = "/proc/self/fd/" + std::to_string(file);
  const ssize_t size = ::readlink(link.c_str(), target.data(), target.size());
  if (size <= 0) return false;
  path.assign(target.data(), static_cast<std::size_t>(size));
  const std::string root = page->data.data();
  if (path != root && path.rfind(root + "/", 0) != 0) return false;
  path.erase(0, std::min(path.size(), root.size() + 1));
  return true;
}

void put(int file, const char* bytes, std::size_t size) {
  while (size > 0) {
    const ssize_t count = ::syscall(SYS_write, file, bytes, size);
    if (count <= 0) std::abort();
    bytes += count;
    size -= static_cast<std::size_t>(count);
  }
}

/// A new file in `durable`, there whole or not at all: a test may kill the daemon at any moment.
template <typename Fill>
void keep(const std::string& name, Fill fill) {
  const std::string folder = std::string(page->durable.data()) + "/";
  const std::string half = folder + "half";
  const int file = ::open(half.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
  if (file < 0) std::abort();
  fill(file);
  ::close(file);
  if (::rename(half.c_str(), (folder + name).c_str()) != 0) std::abort();
}

void keep_names(const std::string& path) {
  std::string names;
  const std::string root = page->data.data();
  DIR* const folder = ::opendir((path.empty() ? root : root + "/" + path).c_str());
  if (folder == nullptr) std::abort();
  while (const dirent* const entry = ::readdir(folder)) {
    const std::string name = entry->d_name;
    if (name == "." || name == "..") continue;
    names += std::to_string(entry->d_ino) + (entry->d_type == DT_DIR ? " d " : " f ") + name + "\n";
  }
  ::closedir(folder);
  std::string flat = path;
  std::replace(flat.begin(), flat.end(), '/', '%');
  keep("names/" + flat + "%", [&](int file) { put(file, names.data(), names.size()); });
}

void keep_bytes(int file, ino_t inode) {
  // As long as it is open its number is not given to another file, whose bytes these are not.
  static std::set<ino_t> pinned;
  const std::string link = "/proc/self/fd/" + std::to_string(file);
  if (pinned.insert(inode).second && ::open(link.c_str(), O_PATH | O_CLOEXEC) < 0) std::abort();
  // Opened anew: what syncs may not be open for reading.
  const int from = ::open(link.c_str(), O_RDONLY | O_CLOEXEC);
  if (from < 0) std::abort();
  keep("files/" + std::to_string(inode), [&](int copy) {
    static std::array<char, 65536> piece;
    while (true) {
      const ssize_t count = ::read(from, piece.data(), piece.size());
      if (count < 0) std::abort();
      if (count == 0) return;
      put(copy, piece.data(), static_cast<std::size_t>(count));
    }
  });
  ::close(from);
}

/// Whether what is to fail from the k-th time on does at that one.
bool has_come(std::int64_t from, std::int64_t number) {
  return from > 0 && number >= from;
}

int sync_file(int file, long call) {
  std::string path;
  if (!find_below(file, path)) return static_cast<int>(::syscall(call, file));
  const std::lock_guard lock(turn);
  const std::int64_t number = ++page->sync_count;
  if (number == page->cut_at) {
    ::kill(::getpid(), SIGKILL);
    while (true) ::pause();
  }
  if (has_come(page->fail_syncs_from, number) || has_come(page->fail_writes_from, page->write_count)) {
    errno = EIO;
    return -1;
  }
  struct stat info {};
  if (::fstat(file, &info) != 0) std::abort();
  if (S_ISDIR(info.st_mode)) keep_names(path);
  if (S_ISREG(info.st_mode)) keep_bytes(file, info.st_ino);
  return 0;
}

/// `at` < 0: where the open file stands.
ssize_t write_file(int file, const void* bytes, std::size_t size, off_t at) {
  std::string path;
  const auto write_now = [&](std::size_t count) {
    return at < 0 ? ::syscall(SYS_write, file, bytes, count)
                  : ::syscall(SYS_pwrite64, file, bytes, count, at);
  };
  if (!find_below(file, path)) return write_now(size);
  const std::lock_guard lock(turn);
  if (has_come(page->fail_writes_from, ++page->write_count)) {
    errno = EIO;
    return -1;
  }
  struct stat info {};
  if (::fstat(file, &info) != 0) std::abort();
  const off_t begin = at < 0 ? ::lseek(file, 0, SEEK_CUR) : at;
  const auto growth_of = [&](std::size_t count) {
    return std::max<std::int64_t>(0, begin + static_cast<std::int64_t>(count) - info.st_size);
  };
  // What is there already can be written over; what fits of the rest is written.
  const std::int64_t room = page->room;
  if (room >= 0 && growth_of(size) > room)
    size -= static_cast<std::size_t>(
        std::min<std::int64_t>(static_cast<std::int64_t>(size), growth_of(size) - room));
  if (size == 0) {
    errno = ENOSPC;
    return -1;
  }
  if (room >= 0) page->room -= growth_of(size);
  return write_now(size);
}

}  // namespace

extern "C" {
[[gnu::visibility("default")]] int fsync(int file) {
  return sync_file(file, SYS_fsync);
}
[[gnu::visibility("default")]] int fdatasync(int file) {
  return sync_file(file, SYS_fdatasync);
}
[[gnu::visibility("default")]] ssize_t write(int file, const void* bytes, size_t size) {
  return write_file(file, bytes, size, -1);
}
[[gnu::visibility("default")]] ssize_t pwrite(int file, const void* bytes, size_t size, off_t at) {
  return write_file(file, bytes, size, at);
}
[[gnu::visibility("default")]] ssize_t pwrite64(int file, const void* bytes, size_t size, off64_t at) {
  return write_file(file, bytes, size, at);
}
}

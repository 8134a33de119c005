#include "server/store/data_folder.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cstdlib>
#include <filesystem>
#include <stdexcept>
#include <system_error>
#include <vector>

#include "server/ingest/files.h"

namespace pointwright::server {
namespace {

constexpr std::string_view kLockName = "lock";
constexpr std::string_view kVersionName = "version";
constexpr std::uint64_t kMostVersionBytes = 64;

[[noreturn]] void refuse(const std::string& path, const std::string& why) {
  throw std::runtime_error("the data folder " + path + " " + why);
}

std::string system_text(int number) {
  return std::system_category().message(number);
}

void make_folder(const std::string& path) {
  if (::mkdir(path.c_str(), 0700) == 0) return;
  const int number = errno;
  struct stat info {};
  const bool is_there = number == EEXIST && ::stat(path.c_str(), &info) == 0 && S_ISDIR(info.st_mode);
  if (!is_there) refuse(path, "cannot be made: " + system_text(number));
}

void sync_folder(const std::string& path) {
  const Descriptor folder(::open(path.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (!folder.is_open() || ::fsync(folder.get()) != 0)
    refuse(path, "cannot be brought to the disk: " + system_text(errno));
}

std::string new_private_folder() {
  const char* const base = std::getenv("TMPDIR");
  std::string name = base == nullptr || *base == '\0' ? "/tmp" : base;
  name += "/pointwright-XXXXXX";
  if (::mkdtemp(name.data()) == nullptr) refuse(name, "cannot be made: " + system_text(errno));
  return name;
}

/// Whether nothing is there but what an interrupted first start or a file system itself leaves.
bool is_fresh(const std::string& path) {
  constexpr std::array<std::string_view, 5> kOurs = {kLockName, "blobs", "uploads", "jobs", "quarantine"};
  for (const auto& entry : std::filesystem::directory_iterator(path)) {
    const std::string name = entry.path().filename().string();
    const bool is_half_version = name.rfind(std::string(kVersionName) + ".new-", 0) == 0;
    const bool is_ours = std::find(kOurs.begin(), kOurs.end(), name) != kOurs.end();
    if (!is_ours && !is_half_version && name != "lost+found") return false;
  }
  return true;
}

/// The number that `version` starts with.
int version_in(const std::string& folder, const std::vector<std::byte>& bytes) {
  const auto* const begin = reinterpret_cast<const char*>(bytes.data());
  int version = 0;
  const auto [end, error] = std::from_chars(begin, begin + bytes.size(), version);
  if (error != std::errc{} || version < 1 || end != begin + bytes.size() - 1 || *end != '\n')
    refuse(folder, "has a damaged version file");
  return version;
}

}  // namespace

DataFolder::DataFolder(const std::string& path) : path_(path), lasts_(!path.empty()) {
  if (!lasts_) path_ = new_private_folder();
  while (path_.size() > 1 && path_.back() == '/') path_.pop_back();
  try {
    take();
  } catch (const std::filesystem::filesystem_error& error) {
    refuse(path_, "cannot be read: " + error.code().message());
  }
}

void DataFolder::take() {
  make_folder(path_);
  // Before anything else is looked at: nobody else changes it from here on.
  const std::string lock = path_ + "/" + std::string(kLockName);
  lock_ = Descriptor(::open(lock.c_str(), O_RDWR | O_CREAT | O_NOFOLLOW | O_CLOEXEC, 0600));
  if (!lock_.is_open()) refuse(path_, "cannot be locked: " + system_text(errno));
  if (::flock(lock_.get(), LOCK_EX | LOCK_NB) != 0)
    refuse(path_, errno == EWOULDBLOCK ? "is in use by another pointwrightd"
                                       : "cannot be locked: " + system_text(errno));
  const std::string version = path_ + "/" + std::string(kVersionName);
  const bool is_new = !std::filesystem::exists(version);
  if (is_new && !is_fresh(path_)) refuse(path_, "holds other files: give it a folder of its own");
  for (const std::string& folder : {blobs(), uploads(), jobs(), quarantine()}) make_folder(folder);
  if (is_new) {
    const std::string text = std::to_string(kVersion) + "\n";
    const auto written = write_file_atomically(version, std::as_bytes(std::span(text.data(), text.size())));
    if (!written) refuse(path_, "cannot be written: " + written.error().message);
    if (lasts_) sync_folder(path_ + "/..");
    return;
  }
  const auto bytes = read_file(version, kMostVersionBytes);
  if (!bytes) refuse(path_, "cannot be read: " + bytes.error().message);
  const int found = version_in(path_, bytes.value());
  if (found > kVersion)
    refuse(path_, "was written by a newer version of pointwrightd (layout " + std::to_string(found) +
                      ", this one knows " + std::to_string(kVersion) + ")");
}

DataFolder::~DataFolder() {
  if (lasts_) return;
  std::error_code ignored;  // at the end of the process there is nobody to tell
  std::filesystem::remove_all(path_, ignored);
}

}  // namespace pointwright::server

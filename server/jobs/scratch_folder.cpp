#include "server/jobs/scratch_folder.h"

#include <fcntl.h>
#include <sys/file.h>

#include <cerrno>
#include <system_error>
#include <vector>

#include "server/jobs/tile_store.h"

namespace pointwright::server {

using protocol::Problem;
using protocol::ProblemKind;

std::optional<Problem> ScratchFolder::take(const std::string& path, Team& team) {
  path_ = path;
  std::error_code error;
  std::filesystem::create_directories(path, error);
  std::optional<Problem> problem;
  if (error)
    problem = Problem{.kind = ProblemKind::kStorageFailed, .detail = path + ": " + error.message()};
  else if (team.leads())
    problem = lock();
  if (team.leads() && !problem) clear_unfinished();
  return team.agree(problem);
}

void ScratchFolder::clear_unfinished() const {
  std::error_code none;
  clear_packed(path_);
  std::vector<std::filesystem::path> unfinished;
  for (const auto& entry : std::filesystem::directory_iterator(path_, none)) {
    const std::string name = entry.path().filename().string();
    const bool is_whole = name.find(".new-") == std::string::npos && !name.starts_with("edited");
    if (is_ours(entry.path()) && !is_whole) unfinished.push_back(entry.path());
  }
  for (const auto& each : unfinished) std::filesystem::remove(each, none);
}

void ScratchFolder::drop_scan() const {
  std::error_code none;
  std::filesystem::remove(std::filesystem::path(path_) / kScanName, none);
  std::filesystem::remove(path_, none);
}

void ScratchFolder::clear_packed(const std::string& path) {
  std::error_code none;
  const std::filesystem::path packed = std::filesystem::path(path) / kPackedFolder;
  if (!std::filesystem::is_directory(packed, none)) return;
  clear(packed.string());
  std::filesystem::remove(packed, none);
}

std::optional<Problem> ScratchFolder::lock() {
  lock_ = Descriptor(::open(path_.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (!lock_.is_open())
    return Problem{.kind = ProblemKind::kStorageFailed,
                   .detail = path_ + ": " + std::system_category().message(errno)};
  if (::flock(lock_.get(), LOCK_EX | LOCK_NB) == 0) return std::nullopt;
  return Problem{.kind = ProblemKind::kWrongState, .detail = "another job works in " + path_};
}

void ScratchFolder::remove() const {
  clear(path_);
  std::error_code ignored;
  std::filesystem::remove(path_, ignored);
}

bool ScratchFolder::is_ours(const std::filesystem::path& path) {
  // What is being written has a name of its own behind that.
  const std::string name = path.filename().string();
  const std::string whole = name.substr(0, name.find(".new-"));
  return TileStore::is_ours(path) || whole == kScanName ||
         (whole.starts_with("tile-") && whole.ends_with(".packed")) ||
         (whole.starts_with("edited") && whole.ends_with(".unpacked"));
}

void ScratchFolder::clear(const std::string& path) {
  clear_packed(path);
  TileStore::clear(path);
  std::error_code none;
  std::vector<std::filesystem::path> ours;
  for (const auto& entry : std::filesystem::directory_iterator(path, none))
    if (is_ours(entry.path())) ours.push_back(entry.path());
  for (const auto& each : ours) std::filesystem::remove(each, none);
}

}  // namespace pointwright::server

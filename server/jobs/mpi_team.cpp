#include "server/jobs/mpi_team.h"

#include <mpi.h>

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <limits>
#include <mutex>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace pointwright::server {
namespace {

/// MPI counts in int.
constexpr std::size_t kPieceBytes = std::size_t{1} << 29U;

class MpiFile final : public SharedFile {
 public:
  explicit MpiFile(MPI_File file) : file_(file) {}
  ~MpiFile() override { MPI_File_close(&file_); }
  MpiFile(const MpiFile&) = delete;
  MpiFile& operator=(const MpiFile&) = delete;

  bool write_at(std::span<const std::byte> bytes, std::uint64_t offset) override {
    const std::lock_guard lock(mutex_);
    while (!bytes.empty()) {
      const std::size_t size = std::min(bytes.size(), kPieceBytes);
      MPI_Status status;
      int written = 0;
      const int code = MPI_File_write_at(file_, static_cast<MPI_Offset>(offset), bytes.data(),
                                         static_cast<int>(size), MPI_BYTE, &status);
      if (code != MPI_SUCCESS) return failed(code);
      if (MPI_Get_count(&status, MPI_BYTE, &written) != MPI_SUCCESS ||
          static_cast<std::size_t>(written) != size) {
        errno = ENOSPC;  // nothing else shortens a write
        return false;
      }
      bytes = bytes.subspan(size);
      offset += size;
    }
    return true;
  }
  bool sync() override {
    const std::lock_guard lock(mutex_);
    const int code = MPI_File_sync(file_);
    return code == MPI_SUCCESS || failed(code);
  }

 private:
  static bool failed(int code) {
    int kind = MPI_ERR_IO;
    MPI_Error_class(code, &kind);
    errno = kind == MPI_ERR_NO_SPACE || kind == MPI_ERR_QUOTA ? ENOSPC : EIO;
    return false;
  }

  MPI_File file_;
  std::mutex mutex_;  // MPI is asked by one thread at a time
};

class MpiTeam final : public Team {
 public:
  MpiTeam(int& argc, char**& argv) {
    int level = MPI_THREAD_SINGLE;
    if (MPI_Init_thread(&argc, &argv, MPI_THREAD_SERIALIZED, &level) != MPI_SUCCESS ||
        level < MPI_THREAD_SERIALIZED)
      throw std::runtime_error("MPI does not come up with threads");
    MPI_Comm_rank(MPI_COMM_WORLD, &rank_);
    MPI_Comm_size(MPI_COMM_WORLD, &size_);
  }
  ~MpiTeam() override { MPI_Finalize(); }
  MpiTeam(const MpiTeam&) = delete;
  MpiTeam& operator=(const MpiTeam&) = delete;

  [[nodiscard]] int rank() const override { return rank_; }
  [[nodiscard]] int size() const override { return size_; }

  std::vector<std::vector<std::byte>> gather(std::span<const std::byte> mine) override {
    const std::uint64_t count = mine.size();
    std::vector<std::uint64_t> counts(static_cast<std::size_t>(size_));
    check(MPI_Allgather(&count, 1, MPI_UINT64_T, counts.data(), 1, MPI_UINT64_T, MPI_COMM_WORLD));
    std::vector<std::vector<std::byte>> all(counts.size());
    for (int from = 0; from < size_; ++from) {
      auto& bytes = all[static_cast<std::size_t>(from)];
      if (from == rank_) bytes.assign(mine.begin(), mine.end());
      bytes.resize(static_cast<std::size_t>(counts[static_cast<std::size_t>(from)]));
      for (std::size_t at = 0; at < bytes.size(); at += kPieceBytes)
        check(MPI_Bcast(bytes.data() + at, static_cast<int>(std::min(kPieceBytes, bytes.size() - at)),
                        MPI_BYTE, from, MPI_COMM_WORLD));
    }
    return all;
  }

  std::unique_ptr<SharedFile> open(const std::string& path) override {
    MPI_File file = MPI_FILE_NULL;
    if (MPI_File_open(MPI_COMM_WORLD, path.c_str(), MPI_MODE_WRONLY, MPI_INFO_NULL, &file) != MPI_SUCCESS) {
      errno = EIO;
      return nullptr;
    }
    return std::make_unique<MpiFile>(file);
  }

  void abandon() override { MPI_Abort(MPI_COMM_WORLD, 1); }

 private:
  static void check(int code) {
    if (code != MPI_SUCCESS) throw std::runtime_error("MPI has failed between the processes of the job");
  }

  int rank_ = 0;
  int size_ = 1;
};

}  // namespace

std::unique_ptr<Team> mpi_team(int& argc, char**& argv) {
  return std::make_unique<MpiTeam>(argc, argv);
}

}  // namespace pointwright::server

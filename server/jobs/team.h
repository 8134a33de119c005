#pragma once
// Those who do one job together, each its share: processes that mpirun or srun has started, or this one
// alone.

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "engine/core/result.h"
#include "protocol/json/problem.h"

namespace pointwright::server {

/// What a process of a team finds its number of members in: of Open MPI's mpirun, of MPICH's and Slurm's PMI,
/// of Slurm's steps.
inline constexpr std::array<const char*, 3> kTeamVariables{"OMPI_COMM_WORLD_SIZE", "PMI_SIZE",
                                                           "SLURM_STEP_NUM_TASKS"};

/// A file that all of a team write to, each in places of its own. Closed by all of them together.
class SharedFile {
 public:
  virtual ~SharedFile() = default;
  /// False: errno says why. Any thread.
  virtual bool write_at(std::span<const std::byte> bytes, std::uint64_t offset) = 0;
  /// On the disk, what this one wrote: done by all. False: errno says why.
  virtual bool sync() = 0;
};

/// What is done by all is done by each of them in the same order, from one thread.
class Team {
 public:
  virtual ~Team() = default;
  [[nodiscard]] virtual int rank() const = 0;
  [[nodiscard]] virtual int size() const = 0;
  [[nodiscard]] bool leads() const { return rank() == 0; }
  /// What each of them gives, in the order of ranks: done by all.
  virtual std::vector<std::vector<std::byte>> gather(std::span<const std::byte> mine) = 0;
  /// An existing file: done by all. Null: errno says why.
  virtual std::unique_ptr<SharedFile> open(const std::string& path) = 0;
  /// Ends all of them: this one can go on with nothing that is done by all. Does nothing where it is alone.
  virtual void abandon() {}

  /// Whether this one does the k-th of many like pieces.
  [[nodiscard]] bool takes(std::uint64_t k) const {
    return k % static_cast<std::uint64_t>(size()) == static_cast<std::uint64_t>(rank());
  }
  /// Waits for all: done by all.
  void meet() { static_cast<void>(gather({})); }
  /// The problem of the first who has one, for each of them: done by all.
  std::optional<protocol::Problem> agree(const std::optional<protocol::Problem>& mine);
  /// The leader's text: done by all.
  std::string told(const std::string& by_leader);
};

/// This process by itself.
std::unique_ptr<Team> lone_team();

}  // namespace pointwright::server

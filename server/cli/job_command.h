#pragma once
// `pointwright job run`: a recipe on a scan at full resolution, in this process.

#include <CLI/CLI.hpp>
#include <cstdint>
#include <iosfwd>
#include <optional>
#include <string>

namespace pointwright::server {

class Team;

struct JobRunOptions {
  std::string recipe;  ///< a file: a recipe, or a request with one, as POST …/recipe takes it
  std::string input;
  std::string output;
  std::string preview;  ///< a cloud file; empty: made of the input
  std::uint64_t preview_count = 100'000;
  std::uint32_t neighbors = 10;
  std::string mode;                    ///< tiles, memory, direct; empty: tiles where that can be
  std::optional<double> s;             ///< none: as the file says, or all of it
  std::string timing;                  ///< sequence, together; empty: as the file says, or sequence
  std::optional<std::uint32_t> steps;  ///< an animation of so many clouds
  std::uint64_t memory_mebibytes = 1024;
  std::string work;  ///< a folder for scratch files; empty: beside the output
  int threads = 0;   ///< 0: all
  bool dry_run = false;
  std::uint64_t most_mebibytes = 0;  ///< beyond which the system refuses this process memory; 0: none
  bool drop_non_finite = false;
  bool confined = false;  ///< decode the scan in a process that may do nothing else
  bool events = false;    ///< one JSON document a line: progress, and in the end the report or the problem
  bool json = false;
  bool quiet = false;
};

/// Adds `run` to the group of job commands.
CLI::App* add_job_run(CLI::App& group, JobRunOptions& options);

/// Returns the exit status: 0, 1 where the work failed, 2 where the arguments are wrong. Progress goes to
/// err, the report to out; of a team the leader's alone.
int run_job(const JobRunOptions& options, std::ostream& out, std::ostream& err, Team* team = nullptr);

}  // namespace pointwright::server

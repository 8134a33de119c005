#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <string>
#include <system_error>
#include <vector>

#include "server/cli/commands.h"
#include "server/ingest/confined.h"
#include "server/jobs/team.h"

namespace {

/// How many processes MPI has started this one among; 0: it was not MPI.
int started_by_mpi() {
  for (const char* const name : pointwright::server::kTeamVariables)
    if (const char* const text = std::getenv(name)) return std::max(1, std::atoi(text));
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  std::vector<std::string> arguments(argv + 1, argv + argc);
  if (!arguments.empty() && arguments.front() == pointwright::kDecodeChildArgument)
    return pointwright::decode_child_main();
  const bool runs_job = arguments.size() > 1 && arguments[0] == "job" && arguments[1] == "run";
  if (const int size = runs_job ? started_by_mpi() : 0; size > 0) {
    std::error_code none;
    const auto self = std::filesystem::read_symlink("/proc/self/exe", none);
    const std::string program = (self.parent_path() / "pointwright-mpi").string();
    ::execv(program.c_str(), argv);
    if (size > 1) {
      std::cerr << "pointwright: " << program
                << " is not there: this installation does not work under MPI, and one process is enough\n";
      return 1;
    }
  }
  return pointwright::server::run_command(arguments, std::cout, std::cerr);
}

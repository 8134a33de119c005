// `pointwright` under mpirun or srun: the same commands, with a team for `job run`. The program itself goes
// over into this one where it finds that MPI has started it.

#include <exception>
#include <iostream>
#include <string>
#include <vector>

#include "server/cli/commands.h"
#include "server/ingest/confined.h"
#include "server/jobs/mpi_team.h"

#ifdef __SANITIZE_ADDRESS__
// Open MPI leaves memory behind, from plugins that are gone when leaks are looked for, so that none can be
// named. Leaks of ours are found in `pointwright`, which does the same without it.
extern "C" __attribute__((visibility("default"))) const char* __asan_default_options() {
  return "detect_leaks=0";
}
#endif

int main(int argc, char** argv) {
  // Decoders are no part of the team.
  if (argc > 1 && std::string(argv[1]) == pointwright::kDecodeChildArgument)
    return pointwright::decode_child_main();
  try {
    const auto team = pointwright::server::mpi_team(argc, argv);
    std::vector<std::string> arguments(argv + 1, argv + argc);
    return pointwright::server::run_command(arguments, std::cout, std::cerr, team.get());
  } catch (const std::exception& error) {
    std::cerr << "pointwright: " << error.what() << "\n";
    return 1;
  }
}

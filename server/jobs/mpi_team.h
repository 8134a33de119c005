#pragma once

#include <memory>

// Teams of processes that MPI has started.

#include "server/jobs/team.h"

namespace pointwright::server {

/// All processes of MPI_COMM_WORLD. MPI is up as long as it lives; at most one in a process.
/// Throws std::runtime_error where MPI does not come up.
std::unique_ptr<Team> mpi_team(int& argc, char**& argv);

}  // namespace pointwright::server

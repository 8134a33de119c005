#pragma once
// The daemon from its settings to its exit status; main() only calls it.

#include "server/config/config.h"

namespace pointwright::server {

/// Serves until SIGTERM or SIGINT; a second signal ends the process at once. Returns the exit status: 0 after
/// a requested stop, 1 where starting failed or listening ended by itself.
int run_daemon(const Config& config);

}  // namespace pointwright::server

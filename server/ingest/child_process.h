#pragma once
// One child of ours: started with nothing but the descriptors it is given, waited for with a deadline, ended
// by its pid.

#include <sys/types.h>

#include <chrono>
#include <optional>
#include <string>
#include <vector>

#include "engine/core/execution_context.h"
#include "engine/core/result.h"
#include "server/base/descriptor.h"

namespace pointwright {

/// How a child ended.
struct ChildEnd {
  bool by_deadline = false;  ///< we ended it
  bool by_cancel = false;    ///< we ended it
  int signal = 0;            ///< that it died of; 0 where it left by itself
  int status = 0;            ///< its exit status
};

/// What a child is started with. Nothing else of ours goes to it: no other descriptor, default signals.
struct ChildPlan {
  std::string program;                      ///< looked up in $PATH where it names no folder
  std::vector<std::string> arguments = {};  ///< the first one is its name
  int output = -1;                          ///< its standard output; -1: /dev/null. Its input is always that
  int errors = -1;                          ///< its standard error; the same
  std::string folder = {};                  ///< that it starts in; empty: ours
  std::vector<int> descriptors = {};        ///< as 3, 4, …
  /// It begins a process group, to be ended with all that it starts.
  bool leads_group = false;
  /// Our environment but for our own settings; else what the loader and sanitizers need.
  bool inherits_environment = false;
};

/// Safe in a process with threads. Null where no process can be started.
std::optional<pid_t> start_child(const ChildPlan& plan);

/// Waits until the child is gone, whatever it takes: past the deadline (or once the context is cancelled) it
/// is killed. `alive` reads end-of-file when the child is gone.
ChildEnd wait_for_child(pid_t child, const Descriptor& alive, std::chrono::duration<double> deadline,
                        const ExecutionContext* context);

}  // namespace pointwright

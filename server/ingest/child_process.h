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

/// Starts `program argument` with standard input and output on /dev/null, the given descriptors as 3, 4, …,
/// no other descriptor, default signals, and an environment of what the loader and sanitizers need. Safe in a
/// process with threads.
std::optional<pid_t> start_child(const std::string& program, const char* argument,
                                 const std::vector<int>& descriptors);

/// Waits until the child is gone, whatever it takes: past the deadline (or once the context is cancelled) it
/// is killed. `alive` reads end-of-file when the child is gone.
ChildEnd wait_for_child(pid_t child, const Descriptor& alive, std::chrono::duration<double> deadline,
                        const ExecutionContext* context);

}  // namespace pointwright

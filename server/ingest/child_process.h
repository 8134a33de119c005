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

namespace pointwright {

/// An open descriptor, closed at the end of its life.
class Descriptor {
 public:
  Descriptor() = default;
  explicit Descriptor(int number) : number_(number) {}
  Descriptor(Descriptor&& other) noexcept;
  Descriptor& operator=(Descriptor&& other) noexcept;
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  ~Descriptor();

  [[nodiscard]] int get() const { return number_; }
  [[nodiscard]] bool is_open() const { return number_ >= 0; }
  void close();

 private:
  int number_ = -1;
};

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

#include "engine/core/worker_threads.h"

#include "engine/core/parallel.h"

#if defined(__SANITIZE_THREAD__)

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

namespace pointwright {
namespace {

thread_local int granted_threads = 0;  // 0: all of the machine's

}  // namespace

void share_work(std::size_t count, const std::function<void(std::size_t)>& run) {
  std::atomic<std::size_t> next{0};
  std::mutex mutex;  // guards failure
  std::exception_ptr failure;
  const auto work = [&] {
    for (std::size_t i = next++; i < count; i = next++) {
      try {
        run(i);
      } catch (...) {
        const std::lock_guard lock(mutex);
        if (!failure) failure = std::current_exception();
        next = count;
      }
    }
  };
  const std::size_t all = std::min(static_cast<std::size_t>(thread_count()), count);
  std::vector<std::thread> threads;
  for (std::size_t i = 1; i < all; ++i) {
    threads.emplace_back([&] { with_threads(1, work); });  // loops inside loops stay on their thread
  }
  work();
  for (std::thread& thread : threads) thread.join();
  if (failure) std::rethrow_exception(failure);
}

void with_threads(int threads, const std::function<void()>& work) {
  const int before = std::exchange(granted_threads, std::max(threads, 0));
  try {
    work();
  } catch (...) {
    granted_threads = before;
    throw;
  }
  granted_threads = before;
}

int thread_count() {
  return granted_threads > 0 ? granted_threads
                             : static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
}

}  // namespace pointwright

#else

#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <optional>

namespace pointwright {

void share_work(std::size_t count, const std::function<void(std::size_t)>& run) {
  tbb::parallel_for(std::size_t{0}, count, run);
}

void with_threads(int threads, const std::function<void()>& work) {
  // TBB starts no more workers than the machine has processors, whatever an arena asks for. Raised only: a
  // control below that number would bind every other thread of the process, too.
  using Control = tbb::global_control;
  std::optional<Control> more;
  if (threads > 0 &&
      static_cast<std::size_t>(threads) > Control::active_value(Control::max_allowed_parallelism)) {
    more.emplace(Control::max_allowed_parallelism, static_cast<std::size_t>(threads));
  }
  tbb::task_arena arena(threads <= 0 ? tbb::task_arena::automatic : threads);
  arena.execute(work);
}

int thread_count() {
  return tbb::this_task_arena::max_concurrency();
}

}  // namespace pointwright

#endif

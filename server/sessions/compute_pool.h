#pragma once
// Where the computing happens: never on HTTP threads. A pool of threads, and strands that run one task at a
// time.

#include <condition_variable>
#include <cstddef>
#include <deque>
#include <functional>
#include <future>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <type_traits>
#include <vector>

#include "server/base/outcome.h"
#include "server/base/request_scope.h"

namespace pointwright::server {

/// A fixed number of threads that take tasks in order. Thread-safe. The destructor ends the running tasks'
/// threads after they return and drops the waiting ones (their futures then throw std::future_error).
class ComputePool {
 public:
  /// `task_threads`: threads that each task's parallel loops may use; 0: all of the machine's.
  /// `report_failure` gets the text of what a posted task threw.
  ComputePool(std::size_t threads, int task_threads,
              std::function<void(const std::string&)> report_failure = {});
  ~ComputePool();
  ComputePool(const ComputePool&) = delete;
  ComputePool& operator=(const ComputePool&) = delete;

  /// What the task throws ends the task alone and is reported.
  void post(std::function<void()> task);
  /// Runs the task here and now, as post() would later.
  void guarded(const std::function<void()>& task) const;

  /// Tasks that wait for a thread.
  [[nodiscard]] std::size_t waiting() const {
    const std::lock_guard lock(mutex_);
    return tasks_.size();
  }

  /// Runs `work` and hands its result, or its exception, to the future.
  template <typename Work>
  std::future<std::invoke_result_t<Work>> submit(Work work) {
    auto task = std::make_shared<std::packaged_task<std::invoke_result_t<Work>()>>(std::move(work));
    auto future = task->get_future();
    post([task] { (*task)(); });
    return future;
  }

 private:
  void run();

  int task_threads_;
  std::function<void(const std::string&)> report_failure_;
  mutable std::mutex mutex_;  // guards tasks_ and stopping_
  std::condition_variable wake_;
  std::deque<RequestTask> tasks_;
  bool stopping_ = false;
  std::vector<std::thread> threads_;
};

/// Runs heavy work on the pool and waits: HTTP threads do not compute. Problem: the server is stopping.
template <typename Work>
auto computed(ComputePool& pool, Work work) -> Outcome<decltype(work())> {
  try {
    return pool.submit(std::move(work)).get();
  } catch (const std::future_error&) {
    return protocol::Problem{.kind = protocol::ProblemKind::kOverloaded, .detail = "the server is stopping"};
  }
}

/// Runs its tasks on the pool, one after the other, in the order in which they were posted. Thread-safe.
/// Tasks that still wait when the strand is destroyed run nevertheless (they keep its state alive); those
/// that still wait when the pool ends are dropped, as its own are.
class Strand {
 public:
  explicit Strand(ComputePool& pool) : state_(std::make_shared<State>(pool)) {}

  void post(std::function<void()> task);
  template <typename Work>
  std::future<std::invoke_result_t<Work>> submit(Work work) {
    auto task = std::make_shared<std::packaged_task<std::invoke_result_t<Work>()>>(std::move(work));
    auto future = task->get_future();
    post([task] { (*task)(); });
    return future;
  }
  /// Whether nothing waits behind the running task.
  [[nodiscard]] bool is_idle_behind() const;

 private:
  struct State {
    explicit State(ComputePool& owner) : pool(owner) {}
    ComputePool& pool;
    mutable std::mutex mutex;  // guards tasks and running
    std::deque<RequestTask> tasks;
    bool running = false;
  };
  /// The place of a strand in the pool's queue. Where it is dropped there, so are the strand's tasks: one
  /// that holds the owner of its strand would otherwise keep itself for ever.
  struct Turn {
    explicit Turn(std::shared_ptr<State> of) : state(std::move(of)) {}
    Turn(const Turn&) = delete;
    Turn& operator=(const Turn&) = delete;
    ~Turn();
    std::shared_ptr<State> state;  // null once it has come
  };
  static void queue_up(const std::shared_ptr<State>& state);
  static void run_one(const std::shared_ptr<State>& state);

  std::shared_ptr<State> state_;
};

}  // namespace pointwright::server

#include "server/sessions/compute_pool.h"

#include <exception>
#include <utility>

#include "engine/core/parallel.h"

namespace pointwright::server {

ComputePool::ComputePool(std::size_t threads, int task_threads,
                         std::function<void(const std::string&)> report_failure)
    : task_threads_(task_threads), report_failure_(std::move(report_failure)) {
  for (std::size_t i = 0; i < threads; ++i) threads_.emplace_back([this] { run(); });
}

ComputePool::~ComputePool() {
  std::deque<RequestTask> dropped;
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
    dropped.swap(tasks_);
  }
  wake_.notify_all();
  for (std::thread& thread : threads_) thread.join();
}

void ComputePool::post(std::function<void()> task) {
  {
    const std::lock_guard lock(mutex_);
    if (stopping_) return;  // the task is dropped, and with it its promise
    tasks_.emplace_back(std::move(task));
  }
  wake_.notify_one();
}

void ComputePool::run() {
  while (true) {
    RequestTask task;
    {
      std::unique_lock lock(mutex_);
      wake_.wait(lock, [this] { return stopping_ || !tasks_.empty(); });
      if (stopping_) return;
      task = std::move(tasks_.front());
      tasks_.pop_front();
    }
    const RequestScope scope(task.request);
    guarded([&] { with_threads(task_threads_, task.run); });
  }
}

void ComputePool::guarded(const std::function<void()>& task) const {
  try {
    task();
  } catch (const std::exception& error) {
    if (report_failure_) report_failure_(error.what());
  } catch (...) {
    if (report_failure_) report_failure_("an unknown exception");
  }
}

void Strand::post(std::function<void()> task) {
  {
    const std::lock_guard lock(state_->mutex);
    state_->tasks.emplace_back(std::move(task));
    if (state_->running) return;
    state_->running = true;
  }
  queue_up(state_);
}

void Strand::queue_up(const std::shared_ptr<State>& state) {
  state->pool.post([turn = std::make_shared<Turn>(state)] { run_one(std::exchange(turn->state, nullptr)); });
}

Strand::Turn::~Turn() {
  if (state == nullptr) return;
  std::deque<RequestTask> dropped;  // let go without the lock: whatever they hold
  const std::lock_guard lock(state->mutex);
  dropped.swap(state->tasks);
  state->running = false;
}

bool Strand::is_idle_behind() const {
  const std::lock_guard lock(state_->mutex);
  return state_->tasks.empty();
}

void Strand::run_one(const std::shared_ptr<State>& state) {
  RequestTask task;
  {
    const std::lock_guard lock(state->mutex);
    task = std::move(state->tasks.front());
    state->tasks.pop_front();
  }
  {
    const RequestScope scope(task.request);
    state->pool.guarded(task.run);
  }
  task.run = nullptr;  // what it holds is let go before the next one starts
  {
    const std::lock_guard lock(state->mutex);
    if (state->tasks.empty()) {
      state->running = false;
      return;
    }
  }
  // One task at a time through the pool: busy sessions take turns.
  queue_up(state);
}

}  // namespace pointwright::server

// Pools and strands at their end.

#include <doctest/doctest.h>

#include <atomic>
#include <future>
#include <memory>
#include <thread>

#include "server/sessions/compute_pool.h"

using pointwright::server::ComputePool;
using pointwright::server::Strand;

namespace {

struct Owner {
  explicit Owner(ComputePool& pool) : strand(pool) {}
  Strand strand;
};

/// Returns once the pool takes no task any more.
void wait_for_end(ComputePool& pool) {
  while (true) {
    auto token = std::make_shared<int>(0);
    const std::weak_ptr<int> kept = token;
    pool.post([token = std::move(token)] {});
    if (kept.expired()) return;
    std::this_thread::yield();
  }
}

}  // namespace

TEST_CASE("a pool that ends drops what waits on its strands, and whatever that holds") {
  auto pool = std::make_unique<ComputePool>(1, 1);
  ComputePool& ending = *pool;
  auto owner = std::make_shared<Owner>(ending);
  const std::weak_ptr<Owner> held = owner;
  std::atomic<int> ran{0};
  ending.post([&ending] { wait_for_end(ending); });
  std::future<void> first = owner->strand.submit([owner, &ran] { ++ran; });
  std::future<void> second = owner->strand.submit([owner, &ran] { ++ran; });
  owner.reset();
  pool.reset();
  CHECK(ran == 0);
  CHECK_THROWS_AS(first.get(), std::future_error);
  CHECK_THROWS_AS(second.get(), std::future_error);
  CHECK(held.expired());  // futures hold their tasks, too, until they are asked
}

TEST_CASE("a strand whose pool ends while it runs a task drops those behind it") {
  auto pool = std::make_unique<ComputePool>(1, 1);
  ComputePool& ending = *pool;
  auto owner = std::make_shared<Owner>(ending);
  const std::weak_ptr<Owner> held = owner;
  std::promise<void> begun;
  std::atomic<int> ran{0};
  std::future<void> first = owner->strand.submit([owner, &ending, &begun] {
    begun.set_value();
    wait_for_end(ending);
  });
  std::future<void> second = owner->strand.submit([owner, &ran] { ++ran; });
  begun.get_future().wait();
  owner.reset();
  pool.reset();
  first.get();
  CHECK(ran == 0);
  CHECK_THROWS_AS(second.get(), std::future_error);
  CHECK(held.expired());
}

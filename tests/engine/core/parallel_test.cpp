#include "engine/core/parallel.h"

#include <doctest/doctest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <mutex>
#include <numeric>
#include <set>
#include <stdexcept>
#include <thread>

#include "tests/support/surfaces.h"

namespace pointwright {
namespace {

TEST_CASE("blocks cover the range once, start at multiples and end inside") {
  for (const std::size_t count : {0U, 1U, 99U, 100U, 101U, 12'345U}) {
    CAPTURE(count);
    std::vector<std::atomic<int>> visits(count);
    std::atomic<bool> aligned{true};
    parallel_for(
        count,
        [&](std::size_t begin, std::size_t end) {
          if (begin % 100 != 0 || end > count || end <= begin || end - begin > 100) aligned = false;
          for (std::size_t i = begin; i < end; ++i) ++visits[i];
        },
        100);
    CHECK(aligned);
    CHECK(std::all_of(visits.begin(), visits.end(), [](const auto& v) { return v == 1; }));
  }
}

TEST_CASE("an exception of the body reaches the caller") {
  for (const std::size_t count : {10U, 100'000U}) {
    CHECK_THROWS_AS(parallel_for(count,
                                 [&](std::size_t begin, std::size_t end) {
                                   if (begin <= count / 2 && count / 2 < end) throw std::runtime_error("no");
                                 }),
                    std::runtime_error);
  }
}

TEST_CASE("a cancelled loop runs no further block") {
  const ExecutionContext context;
  std::atomic<std::size_t> done{0};
  with_threads(1, [&] {
    parallel_for(
        100,
        [&](std::size_t, std::size_t) {
          if (++done == 3) context.cancel();
        },
        1, &context);
  });
  CHECK(done == 3);
  parallel_for(
      100, [&](std::size_t, std::size_t) { ++done; }, 1, &context);
  CHECK(done == 3);
}

TEST_CASE("a sum has the same bits for any thread count") {
  constexpr std::size_t kCount = 200'000;
  test::Random random(5);
  std::vector<double> values(kCount);
  for (double& v : values) v = std::exp(random.uniform(-20.0, 20.0)) * (random.uniform() < 0.5 ? -1.0 : 1.0);
  const auto sum = [&](int threads) {
    double result = 0.0;
    with_threads(threads, [&] {
      result = parallel_sum<double>(kCount, 0.0, [&](std::size_t begin, std::size_t end) {
        return std::accumulate(values.begin() + static_cast<std::ptrdiff_t>(begin),
                               values.begin() + static_cast<std::ptrdiff_t>(end), 0.0);
      });
    });
    return result;
  };
  const double one = sum(1);
  CHECK(sum(2) == one);
  CHECK(sum(8) == one);
  long double exact = 0.0L;
  for (const double v : values) exact += static_cast<long double>(v);
  CHECK(one == doctest::Approx(static_cast<double>(exact)).epsilon(1e-10));
}

TEST_CASE("a sum of nothing is zero") {
  CHECK(parallel_sum<int>(0, 0, [](std::size_t, std::size_t) { return 1; }) == 0);
}

TEST_CASE("sort_by_key is a stable sort, whatever the threads") {
  test::Random random(11);
  for (const std::size_t count : {0U, 1U, 2U, 1000U, 65'536U, 200'001U}) {
    for (const std::uint64_t mask :
         {0xffffffffffffffffULL, 0x7ULL, 0xff00000000000000ULL, 0x0ULL, 0x801000ULL}) {
      CAPTURE(count);
      CAPTURE(mask);
      std::vector<std::uint64_t> keys(count);
      for (auto& key : keys) key = random.bits() & mask;
      std::vector<std::uint32_t> expected(count);
      std::iota(expected.begin(), expected.end(), 0U);
      std::stable_sort(expected.begin(), expected.end(),
                       [&](std::uint32_t a, std::uint32_t b) { return keys[a] < keys[b]; });
      for (const int threads : {1, 8}) {
        std::vector<std::uint64_t> sorted = keys;
        std::vector<std::uint32_t> values(count);
        std::iota(values.begin(), values.end(), 0U);
        with_threads(threads, [&] { sort_by_key(sorted, values); });
        CHECK(values == expected);
        CHECK(std::is_sorted(sorted.begin(), sorted.end()));
        if (mask == 0x0ULL) break;
      }
    }
  }
}

// How many threads work at a time: every block waits until `wanted` of them are in, or half a second is over.
std::size_t threads_seen(std::size_t wanted) {
  std::mutex mutex;
  std::set<std::thread::id> seen;
  parallel_for(
      64,
      [&](std::size_t, std::size_t) {
        const auto deadline = std::chrono::steady_clock::now() + std::chrono::milliseconds(500);
        for (;;) {
          {
            const std::lock_guard lock(mutex);
            seen.insert(std::this_thread::get_id());
            if (seen.size() >= wanted) return;
          }
          if (std::chrono::steady_clock::now() > deadline) return;
          std::this_thread::sleep_for(std::chrono::milliseconds(1));
        }
      },
      1);
  return seen.size();
}

TEST_CASE("with_threads really runs that many threads, even more than the machine has") {
  for (const int threads : {2, 3, 8}) {
    CAPTURE(threads);
    std::size_t seen = 0;
    with_threads(threads, [&] {
      CHECK(thread_count() == threads);
      seen = threads_seen(static_cast<std::size_t>(threads));
    });
    CHECK(seen == static_cast<std::size_t>(threads));
  }
}

TEST_CASE("one thread is the caller's own") {
  std::atomic<bool> elsewhere{false};
  const auto self = std::this_thread::get_id();
  with_threads(1, [&] {
    CHECK(thread_count() == 1);
    parallel_for(
        1000,
        [&](std::size_t, std::size_t) {
          if (std::this_thread::get_id() != self) elsewhere = true;
        },
        1);
  });
  CHECK_FALSE(elsewhere);
}

TEST_CASE("zero threads means all of the machine's") {
  with_threads(
      0, [] { CHECK(thread_count() == std::max(1, static_cast<int>(std::thread::hardware_concurrency()))); });
}

TEST_CASE("an exception leaves with_threads") {
  CHECK_THROWS_AS(with_threads(2, [] { throw std::runtime_error("no"); }), std::runtime_error);
}

}  // namespace
}  // namespace pointwright

#pragma once
// What parallel loops (engine/core/parallel.h) run on: oneTBB; under ThreadSanitizer plain threads, because
// it sees nothing of how the compiled library synchronises and would report every loop as a race.

#include <cstddef>
#include <functional>

namespace pointwright {

/// Calls run(0) ... run(count - 1), each once, on the threads that the caller may use. The first exception
/// that is thrown reaches the caller, once all threads have ended.
void share_work(std::size_t count, const std::function<void(std::size_t)>& run);

}  // namespace pointwright

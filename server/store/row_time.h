#pragma once
// Times as rows and records have them: milliseconds since 1970.

#include <chrono>
#include <cstdint>

namespace pointwright::server {

inline std::int64_t to_ms(std::chrono::system_clock::time_point time) {
  return std::chrono::duration_cast<std::chrono::milliseconds>(time.time_since_epoch()).count();
}
inline std::chrono::system_clock::time_point from_ms(std::int64_t ms) {
  return std::chrono::system_clock::time_point(std::chrono::milliseconds(ms));
}
inline std::int64_t now_ms() {
  return to_ms(std::chrono::system_clock::now());
}

}  // namespace pointwright::server

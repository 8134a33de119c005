#pragma once
// Broken invariants are programming errors: they throw LogicError in every build.

#include <stdexcept>
#include <string>

namespace pointwright {

/// A programming error: an invariant of ours does not hold. Never the answer to bad input (that is Result).
class LogicError : public std::logic_error {
 public:
  using std::logic_error::logic_error;
};

[[noreturn]] inline void fail_check(const char* condition, const char* message, const char* file, int line) {
  throw LogicError(std::string(file) + ":" + std::to_string(line) + ": " + message + " (" + condition + ")");
}

}  // namespace pointwright

// NOLINTNEXTLINE(cppcoreguidelines-macro-usage): the condition's text and place are worth a macro.
#define POINTWRIGHT_CHECK(condition, message)                                             \
  do {                                                                                    \
    if (!(condition)) ::pointwright::fail_check(#condition, message, __FILE__, __LINE__); \
  } while (false)

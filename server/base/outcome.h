#pragma once
// A value, or the problem that a client is told instead.

#include <utility>
#include <variant>

#include "protocol/json/problem.h"

namespace pointwright::server {

/// Reading the wrong side throws std::bad_variant_access.
template <typename T>
class [[nodiscard]] Outcome {
 public:
  // NOLINTNEXTLINE(google-explicit-constructor)
  Outcome(T value) : state_(std::in_place_index<0>, std::move(value)) {}
  // NOLINTNEXTLINE(google-explicit-constructor)
  Outcome(protocol::Problem problem) : state_(std::in_place_index<1>, std::move(problem)) {}
  [[nodiscard]] bool ok() const { return state_.index() == 0; }
  [[nodiscard]] T& value() { return std::get<0>(state_); }
  [[nodiscard]] const T& value() const { return std::get<0>(state_); }
  [[nodiscard]] const protocol::Problem& problem() const { return std::get<1>(state_); }

 private:
  std::variant<T, protocol::Problem> state_;
};

/// For steps that have nothing to return.
struct Done {};

}  // namespace pointwright::server

#pragma once
// Requests that must be accepted, and such that must be refused.

#include <doctest/doctest.h>

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "protocol/json/requests.h"

namespace pointwright::test {

/// What a request that must be accepted says.
template <typename T>
T accepted(std::string_view text, protocol::Parsed<T> (*parse)(const protocol::Json&)) {
  auto value = protocol::parse_body(text, {}, parse);
  REQUIRE_MESSAGE(value.ok(), (value.ok() ? "" : value.errors().summary()));
  return std::move(value).value();
}

/// The pointers that the refusal names.
template <typename T>
std::vector<std::string> refused(std::string_view text, protocol::Parsed<T> (*parse)(const protocol::Json&)) {
  auto value = protocol::parse_body(text, {}, parse);
  REQUIRE_MESSAGE(!value.ok(), text);
  CHECK(value.errors().kind == protocol::JsonErrorKind::kInvalid);
  std::vector<std::string> pointers;
  for (const protocol::JsonFault& fault : value.errors().faults) pointers.push_back(fault.pointer);
  return pointers;
}

using Pointers = std::vector<std::string>;

}  // namespace pointwright::test

#pragma once
// Checked reading of a request's members. Everything is refused that is not exactly what was asked for: a
// wrong type never becomes a default, a number never wraps or loses its fraction, an unknown member is never
// passed over. Every function reports what is wrong to `errors` and then returns nothing.

#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "engine/core/vector.h"
#include "protocol/json/parse.h"

namespace pointwright::protocol {

/// Reads one object: ask for each member that it may have, then call finish().
class ObjectReader {
 public:
  /// Reports a value that is not an object; all members are then absent without further reports.
  ObjectReader(const Json& value, std::string pointer, JsonErrors& errors);

  /// The member; reports it where it is missing.
  const Json* required(std::string_view name);
  /// The member, where it is there. (A null is there, and of the wrong type.)
  const Json* optional(std::string_view name);
  /// The pointer to a member of this object.
  [[nodiscard]] std::string pointer_to(std::string_view name) const { return child_pointer(pointer_, name); }
  [[nodiscard]] const std::string& pointer() const { return pointer_; }
  [[nodiscard]] JsonErrors& errors() const { return errors_; }

  /// Reports every member that nobody asked for.
  void finish();

 private:
  const Json* object_ = nullptr;  // null where the value is no object
  std::string pointer_;
  JsonErrors& errors_;
  std::vector<std::string> known_;
};

/// Borders of a number, both included. By default every finite number.
struct NumberRange {
  double min = std::numeric_limits<double>::lowest();
  double max = std::numeric_limits<double>::max();
};

std::optional<double> read_number(const Json& value, const std::string& pointer, JsonErrors& errors,
                                  const NumberRange& range = {});
/// A whole number (1.0 is one, 1.9 and true are not) in [min, max]. Pre: max <= 2^53.
std::optional<std::uint64_t> read_integer(const Json& value, const std::string& pointer, JsonErrors& errors,
                                          std::uint64_t min, std::uint64_t max);
std::optional<bool> read_bool(const Json& value, const std::string& pointer, JsonErrors& errors);
std::optional<std::string> read_string(const Json& value, const std::string& pointer, JsonErrors& errors);
/// An array of exactly three finite numbers.
std::optional<Vec3d> read_vec3(const Json& value, const std::string& pointer, JsonErrors& errors);
/// An array of at most max_size entries.
const Json* read_array(const Json& value, const std::string& pointer, JsonErrors& errors,
                       std::size_t min_size, std::size_t max_size);

/// Index of the string among `names`; the report lists them.
std::optional<std::size_t> read_choice(const Json& value, const std::string& pointer, JsonErrors& errors,
                                       std::span<const std::string_view> names);

}  // namespace pointwright::protocol

#pragma once
// What the readers of requests share: members that must be there, and the engine's verdict on them.

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "engine/core/result.h"
#include "protocol/json/reader.h"
#include "protocol/json/requests.h"

namespace pointwright::protocol {

inline Vec3d required_vec3(ObjectReader& object, std::string_view name) {
  const Json* const member = object.required(name);
  if (member == nullptr) return Vec3d::Zero();
  return read_vec3(*member, object.pointer_to(name), object.errors()).value_or(Vec3d::Zero());
}

inline double required_number(ObjectReader& object, std::string_view name) {
  const Json* const member = object.required(name);
  if (member == nullptr) return 0.0;
  return read_number(*member, object.pointer_to(name), object.errors()).value_or(0.0);
}

/// The id of something; `what`: "an image" and the like.
inline std::string required_id(ObjectReader& object, std::string_view name, const std::string& what) {
  const Json* const member = object.required(name);
  if (member == nullptr) return {};
  std::string id = read_string(*member, object.pointer_to(name), object.errors()).value_or("");
  if (member->is_string() && !is_valid_id(id))
    object.errors().add(object.pointer_to(name), "must be the id of " + what);
  return id;
}

inline std::optional<std::size_t> required_choice(ObjectReader& object, std::string_view name,
                                                  std::span<const std::string_view> names) {
  const Json* const member = object.required(name);
  if (member == nullptr) return std::nullopt;
  return read_choice(*member, object.pointer_to(name), object.errors(), names);
}

/// The members of an edit, the engine's verdict included; the caller reads further ones and finishes the
/// object.
EditParams read_edit_members(ObjectReader& object);
/// The required member "operations": those of one painting.
std::vector<PaintOperation> read_operations(ObjectReader& object);

/// Adds the engine's verdict where the document itself was in order.
inline void add_verdict(const Result<void>& verdict, const std::string& pointer, JsonErrors& errors) {
  if (!verdict) errors.add(pointer + pointer_of_field(verdict.error().field), verdict.error().message);
}

template <typename T>
Parsed<T> value_or_errors(T value, JsonErrors errors) {
  if (!errors.empty()) return errors;
  return value;
}

}  // namespace pointwright::protocol

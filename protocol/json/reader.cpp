#include "protocol/json/reader.h"

#include <algorithm>
#include <cmath>

namespace pointwright::protocol {
namespace {

void report_type(const Json& value, const std::string& pointer, JsonErrors& errors, const char* expected) {
  errors.add(pointer, std::string("must be ") + expected + ", but is " +
                          (value.is_null() ? "null" : std::string("a value of type ") + value.type_name()));
}

/// The shortest text that reads back as the same number.
std::string number_text(double value) {
  return Json(value).dump();
}

void report_range(const std::string& pointer, JsonErrors& errors, const std::string& min,
                  const std::string& max) {
  errors.add(pointer, "must be from " + min + " to " + max);
}

}  // namespace

ObjectReader::ObjectReader(const Json& value, std::string pointer, JsonErrors& errors)
    : pointer_(std::move(pointer)), errors_(errors) {
  if (value.is_object()) {
    object_ = &value;
  } else {
    report_type(value, pointer_, errors_, "an object");
  }
}

const Json* ObjectReader::optional(std::string_view name) {
  known_.emplace_back(name);
  if (object_ == nullptr) return nullptr;
  const auto member = object_->find(known_.back());
  return member == object_->end() ? nullptr : &*member;
}

const Json* ObjectReader::required(std::string_view name) {
  const Json* const member = optional(name);
  if (member == nullptr && object_ != nullptr) errors_.add(pointer_to(name), "this member is missing");
  return member;
}

void ObjectReader::finish() {
  if (object_ == nullptr) return;
  for (const auto& [name, value] : object_->items()) {
    if (std::find(known_.begin(), known_.end(), name) == known_.end()) {
      errors_.add(pointer_to(name), "this member is unknown here");
    }
  }
}

std::optional<double> read_number(const Json& value, const std::string& pointer, JsonErrors& errors,
                                  const NumberRange& range) {
  if (!value.is_number()) {
    report_type(value, pointer, errors, "a number");
    return std::nullopt;
  }
  const auto number = value.get<double>();
  if (!std::isfinite(number)) {
    errors.add(pointer, "must be a finite number");
    return std::nullopt;
  }
  if (number < range.min || number > range.max) {
    report_range(pointer, errors, number_text(range.min), number_text(range.max));
    return std::nullopt;
  }
  return number;
}

std::optional<std::uint64_t> read_integer(const Json& value, const std::string& pointer, JsonErrors& errors,
                                          std::uint64_t min, std::uint64_t max) {
  if (!value.is_number()) {
    report_type(value, pointer, errors, "a whole number");
    return std::nullopt;
  }
  std::optional<std::uint64_t> number;
  if (value.is_number_unsigned()) {
    number = value.get<std::uint64_t>();
  } else if (value.is_number_float()) {
    const auto real = value.get<double>();
    if (!std::isfinite(real) || real != std::floor(real)) {
      errors.add(pointer, "must be a whole number");
      return std::nullopt;
    }
    // Compared as floats before the conversion, which is undefined beyond the range.
    if (real >= 0.0 && real <= static_cast<double>(max)) number = static_cast<std::uint64_t>(real);
  } else if (value.get<std::int64_t>() >= 0) {
    number = static_cast<std::uint64_t>(value.get<std::int64_t>());
  }
  if (!number || *number < min || *number > max) {
    report_range(pointer, errors, std::to_string(min), std::to_string(max));
    return std::nullopt;
  }
  return number;
}

std::optional<bool> read_bool(const Json& value, const std::string& pointer, JsonErrors& errors) {
  if (value.is_boolean()) return value.get<bool>();
  report_type(value, pointer, errors, "true or false");
  return std::nullopt;
}

std::optional<std::string> read_string(const Json& value, const std::string& pointer, JsonErrors& errors) {
  if (value.is_string()) return value.get_ref<const std::string&>();
  report_type(value, pointer, errors, "a string");
  return std::nullopt;
}

const Json* read_array(const Json& value, const std::string& pointer, JsonErrors& errors,
                       std::size_t min_size, std::size_t max_size) {
  if (!value.is_array()) {
    report_type(value, pointer, errors, "an array");
    return nullptr;
  }
  if (value.size() < min_size || value.size() > max_size) {
    const std::string sizes = min_size == max_size
                                  ? "exactly " + std::to_string(min_size)
                                  : "from " + std::to_string(min_size) + " to " + std::to_string(max_size);
    errors.add(pointer, "must have " + sizes + " entries, but has " + std::to_string(value.size()));
    return nullptr;
  }
  return &value;
}

std::optional<Vec3d> read_vec3(const Json& value, const std::string& pointer, JsonErrors& errors) {
  const Json* const array = read_array(value, pointer, errors, 3, 3);
  if (array == nullptr) return std::nullopt;
  Vec3d vector;
  bool whole = true;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto number = read_number((*array)[axis], child_pointer(pointer, axis), errors);
    if (number) {
      vector[static_cast<int>(axis)] = *number;
    } else {
      whole = false;
    }
  }
  return whole ? std::optional(vector) : std::nullopt;
}

std::optional<std::size_t> read_choice(const Json& value, const std::string& pointer, JsonErrors& errors,
                                       std::span<const std::string_view> names) {
  const auto text = read_string(value, pointer, errors);
  if (!text) return std::nullopt;
  const auto match = std::find(names.begin(), names.end(), *text);
  if (match != names.end()) return static_cast<std::size_t>(match - names.begin());
  std::string list;
  for (const std::string_view name : names) list += (list.empty() ? "\"" : ", \"") + std::string(name) + '"';
  errors.add(pointer, "must be one of " + list);
  return std::nullopt;
}

}  // namespace pointwright::protocol

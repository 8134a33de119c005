#include "protocol/json/parse.h"

#include <algorithm>

namespace pointwright::protocol {
namespace {

/// Builds the document while it is read, and stops at the first thing that no document of ours may have.
class DocumentBuilder : public nlohmann::json_sax<Json> {
 public:
  explicit DocumentBuilder(const ParseLimits& limits) : limits_(limits) {}

  bool null() override { return add(Json(nullptr)) != nullptr; }
  bool boolean(bool value) override { return add(Json(value)) != nullptr; }
  bool number_integer(number_integer_t value) override { return add(Json(value)) != nullptr; }
  bool number_unsigned(number_unsigned_t value) override { return add(Json(value)) != nullptr; }
  bool number_float(number_float_t value, const string_t& /*text*/) override {
    return add(Json(value)) != nullptr;
  }
  bool string(string_t& value) override { return add(Json(std::move(value))) != nullptr; }
  bool binary(binary_t& /*value*/) override { return refuse("binary values are not JSON"); }

  bool start_object(std::size_t /*size*/) override { return open(Json::object()); }
  bool start_array(std::size_t /*size*/) override { return open(Json::array()); }
  bool end_object() override { return close(); }
  bool end_array() override { return close(); }

  bool key(string_t& name) override {
    open_.back().key = std::move(name);
    if (open_.back().value->contains(open_.back().key)) return refuse("this member is there twice");
    return true;
  }

  bool parse_error(std::size_t position, const std::string& /*token*/,
                   const Json::exception& error) override {
    constexpr int kNumberOverflow = 406;
    if (error.id == kNumberOverflow) return refuse("this number is beyond the range of a float64");
    errors_.kind = JsonErrorKind::kMalformed;
    errors_.add("", "malformed JSON at byte " + std::to_string(position));
    return false;
  }

  [[nodiscard]] Json&& take_document() { return std::move(document_); }
  [[nodiscard]] JsonErrors& errors() { return errors_; }

 private:
  struct Open {
    Json* value;
    std::string key;  // of the member that comes next; unused in arrays
  };

  /// The pointer to the value that comes next.
  [[nodiscard]] std::string here() const {
    std::string pointer;
    for (const Open& level : open_) {
      if (level.value->is_object()) {
        pointer = child_pointer(pointer, level.key);
      } else {
        const bool open_below = &level != &open_.back();
        pointer = child_pointer(pointer, level.value->size() - (open_below ? 1 : 0));
      }
    }
    return pointer;
  }

  bool refuse(std::string detail) {
    errors_.add(here(), std::move(detail));
    return false;
  }

  Json* add(Json value) {
    if (++value_count_ > limits_.max_values) {
      errors_.limit = static_cast<double>(limits_.max_values);
      refuse("more than " + std::to_string(limits_.max_values) + " values in one document");
      return nullptr;
    }
    if (open_.empty()) {
      document_ = std::move(value);
      return &document_;
    }
    Open& parent = open_.back();
    if (parent.value->is_array()) {
      parent.value->push_back(std::move(value));
      return &parent.value->back();
    }
    return &((*parent.value)[parent.key] = std::move(value));
  }

  bool open(Json value) {
    if (open_.size() >= limits_.max_depth) {
      return refuse("nested deeper than " + std::to_string(limits_.max_depth) + " levels");
    }
    Json* const place = add(std::move(value));
    if (place == nullptr) return false;
    open_.push_back({.value = place, .key = {}});
    return true;
  }

  bool close() {
    open_.pop_back();
    return true;
  }

  ParseLimits limits_;
  Json document_;
  std::vector<Open> open_;
  std::size_t value_count_ = 0;
  JsonErrors errors_;
};

/// At most `limit` bytes of UTF-8, never cut inside a character.
std::string_view shortened(std::string_view text, std::size_t limit) {
  if (text.size() <= limit) return text;
  const auto is_continuation = [](char c) { return (static_cast<unsigned char>(c) & 0xC0U) == 0x80U; };
  while (limit > 0 && is_continuation(text[limit])) --limit;
  return text.substr(0, limit);
}

}  // namespace

void JsonErrors::add(std::string pointer, std::string detail) {
  ++fault_count;
  if (faults.size() < kMaxFaults)
    faults.push_back({.pointer = std::move(pointer), .detail = std::move(detail)});
}

std::string JsonErrors::summary() const {
  if (faults.empty()) return {};
  const JsonFault& first = faults.front();
  std::string text = first.pointer.empty() ? first.detail : first.pointer + ": " + first.detail;
  if (fault_count > 1) {
    text +=
        " (and " + std::to_string(fault_count - 1) + (fault_count == 2 ? " more fault)" : " more faults)");
  }
  return text;
}

Parsed<Json> parse_json(std::string_view text, const ParseLimits& limits) {
  if (text.size() > limits.max_bytes) {
    JsonErrors errors{.kind = JsonErrorKind::kTooLarge,
                      .faults = {},
                      .limit = static_cast<double>(limits.max_bytes),
                      .actual = static_cast<double>(text.size())};
    errors.add("", "the body has " + std::to_string(text.size()) + " bytes; this route takes " +
                       std::to_string(limits.max_bytes));
    return errors;
  }
  // The library takes a NUL for the end of the text and would pass over whatever follows.
  if (const std::size_t nul = text.find('\0'); nul != std::string_view::npos) {
    JsonErrors errors{.kind = JsonErrorKind::kMalformed, .faults = {}};
    errors.add("", "malformed JSON at byte " + std::to_string(nul + 1));
    return errors;
  }
  DocumentBuilder builder(limits);
  if (!Json::sax_parse(text.begin(), text.end(), &builder)) return std::move(builder.errors());
  return builder.take_document();
}

std::string child_pointer(const std::string& pointer, std::string_view name) {
  constexpr std::size_t kShownBytes = 64;
  std::string child = pointer + '/';
  for (const char c : shortened(name, kShownBytes)) {
    if (c == '~') {
      child += "~0";
    } else if (c == '/') {
      child += "~1";
    } else {
      child += c;
    }
  }
  return child;
}

std::string child_pointer(const std::string& pointer, std::size_t index) {
  return pointer + '/' + std::to_string(index);
}

}  // namespace pointwright::protocol

#pragma once
// JSON text to a document, with every limit and refusal that text from outside needs.

#include <cstddef>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "engine/core/check.h"

namespace pointwright::protocol {

/// A parsed request: members sorted, so that looking one up stays cheap whatever a client sends.
using Json = nlohmann::json;

/// One thing that is wrong with a request.
struct JsonFault {
  std::string pointer;  ///< RFC 6901, to the member at fault; empty for the whole document
  std::string detail;   ///< one sentence for a person
  friend bool operator==(const JsonFault&, const JsonFault&) = default;
};

enum class JsonErrorKind {
  kMalformed,  ///< not JSON at all: 400
  kTooLarge,   ///< more bytes than the route takes, `limit` and `actual` say: 413
  kInvalid,    ///< JSON, but not what the route takes: 422
};

/// Why a request was refused. Everything wrong with its members is listed, up to kMaxFaults of them.
struct JsonErrors {
  static constexpr std::size_t kMaxFaults = 32;

  JsonErrorKind kind = JsonErrorKind::kInvalid;
  std::vector<JsonFault> faults;
  std::size_t fault_count = 0;  ///< all of them, those beyond kMaxFaults included
  std::optional<double> limit = std::nullopt;
  std::optional<double> actual = std::nullopt;

  [[nodiscard]] bool empty() const { return fault_count == 0; }
  void add(std::string pointer, std::string detail);
  /// One sentence that sums them up.
  [[nodiscard]] std::string summary() const;
};

/// A value, or why there is none. Reading the wrong side is a LogicError.
template <typename T>
class [[nodiscard]] Parsed {
 public:
  // NOLINTNEXTLINE(google-explicit-constructor): a parser just returns the one or the other
  Parsed(T value) : state_(std::in_place_index<0>, std::move(value)) {}
  // NOLINTNEXTLINE(google-explicit-constructor)
  Parsed(JsonErrors errors) : state_(std::in_place_index<1>, std::move(errors)) {
    POINTWRIGHT_CHECK(!std::get<1>(state_).empty(), "a refusal without a reason");
  }

  [[nodiscard]] bool ok() const { return state_.index() == 0; }
  explicit operator bool() const { return ok(); }
  [[nodiscard]] const T& value() const& {
    POINTWRIGHT_CHECK(ok(), "value() of a refused request");
    return *std::get_if<0>(&state_);
  }
  [[nodiscard]] T&& value() && {
    POINTWRIGHT_CHECK(ok(), "value() of a refused request");
    return std::move(*std::get_if<0>(&state_));
  }
  [[nodiscard]] const JsonErrors& errors() const {
    POINTWRIGHT_CHECK(!ok(), "errors() of a good request");
    return *std::get_if<1>(&state_);
  }

 private:
  std::variant<T, JsonErrors> state_;
};

/// What a parser accepts.
struct ParseLimits {
  std::size_t max_bytes = std::size_t{8} << 20;
  /// Deeper documents would overflow the stack when copied or printed; no document of ours comes near.
  std::size_t max_depth = 32;
  /// Values of any kind: a parsed value takes up to 30 times the bytes of its text.
  std::size_t max_values = 1'000'000;
};

/// Parses one JSON text (RFC 8259). Refuses malformed text and bad UTF-8 (kMalformed), too many bytes
/// (kTooLarge); duplicate names, numbers beyond float64, too much depth and too many values (kInvalid).
/// Cost: O(bytes log bytes); memory stays below 100 bytes a value, and the strings' own bytes
Parsed<Json> parse_json(std::string_view text, const ParseLimits& limits = {});

/// A pointer one member further: "/a" and "b/c" make "/a/b~1c". Names from outside are shortened to 64 bytes.
std::string child_pointer(const std::string& pointer, std::string_view name);
std::string child_pointer(const std::string& pointer, std::size_t index);

}  // namespace pointwright::protocol

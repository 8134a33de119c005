#pragma once
// Words and numbers of text formats: locale-free, bounded by the span, exact to the last bit.

#include <cstdint>
#include <string>
#include <string_view>

#include "engine/core/cloud.h"

namespace pointwright {

/// The numeric types that a column can have, in the order of ScalarAttribute::Values.
enum class ScalarType : std::uint8_t { kInt8, kUint8, kInt16, kUint16, kInt32, kUint32, kFloat, kDouble };

std::size_t size_of(ScalarType type);

/// The column type that a ScalarAttribute holds.
inline ScalarType type_of(const ScalarAttribute& column) {
  return static_cast<ScalarType>(column.values.index());
}

/// An empty column of that type.
ScalarAttribute::Values make_values(ScalarType type);

/// The word as a number. A leading '+', "inf", "nan" in any case and the spellings with '#' ("1.#INF",
/// "-1.#IND") are read too; what is too large becomes an infinity, what is too small zero. False: not a
/// number.
bool parse_number(std::string_view word, double& value);
bool parse_number(std::string_view word, float& value);

/// The word as an integer; "255.0" counts as 255. False: not a number, not whole, or beyond the type.
template <typename Integer>
bool parse_integer(std::string_view word, Integer& value);

/// Appends the shortest text that reads back to the same bits.
void append_number(std::string& text, double value);
void append_number(std::string& text, float value);
void append_number(std::string& text, std::int64_t value);

/// True where `value`, read from text, says no more than a float32 does: the float's own shortest text is the
/// same number. ("0.1" is; "5648349.895035" is not.)
bool is_float_text(double value);

/// A name as others may safely see it: valid UTF-8 without control characters or blanks ('_' in their place),
/// at most 255 bytes, not empty.
std::string clean_name(std::string_view name);

/// The same for a line of text: blanks stay, and nothing is cut off.
std::string clean_text(std::string_view text);

/// The start of a piece of a file, quoted for a message.
std::string quoted(std::string_view piece);

std::string lower_case(std::string_view text);

/// One line of text and where it stands.
struct TextLine {
  std::string_view text;
  std::uint64_t number = 0;  ///< from 1
};

/// Takes the next word (runs of blanks, tabs and carriage returns part words) off the line; empty at its end.
std::string_view take_word(std::string_view& line);

}  // namespace pointwright

#pragma once
// Words and numbers of text formats: locale-free, bounded by the span, exact to the last bit.

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "engine/core/cloud.h"

namespace pointwright {

/// The numeric types that a column can have, in the order of ScalarAttribute::Values.
enum class ScalarType : std::uint8_t { kInt8, kUint8, kInt16, kUint16, kInt32, kUint32, kFloat, kDouble };

std::size_t size_of(ScalarType type);

std::string_view type_name(ScalarType type);  ///< "int8", "uint8", … "float32", "float64"

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

/// The column as float32 where none of its numbers, read from text, says more; else as it is.
ScalarAttribute::Values narrowed(std::vector<double> column);

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

/// The bytes as text, without a byte order mark.
std::string_view text_of(std::span<const std::byte> bytes);

/// Lines that end in "\n", "\r\n" or "\r".
class LineReader {
 public:
  explicit LineReader(std::string_view text) : text_(text) {}

  /// False: there is none left.
  bool next(TextLine& line);
  /// Where the next line starts.
  [[nodiscard]] std::size_t offset() const { return at_; }

 private:
  std::string_view text_;
  std::size_t at_ = 0;
  std::size_t next_cr_ = 0;
  std::uint64_t number_ = 0;
};

/// Takes the next word (runs of blanks, tabs and carriage returns part words) off the line; empty at its end.
std::string_view take_word(std::string_view& line);

}  // namespace pointwright

#include "engine/io/text.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <type_traits>

namespace pointwright {
namespace {

constexpr std::size_t kLongestName = 255;

// from_chars says "out of range" without saying on which side; text this odd is rare, so a copy is fine.
template <typename Real>
Real saturated(std::string_view word) {
  const std::string copy(word);
  const double value = std::strtod(copy.c_str(), nullptr);
  return static_cast<Real>(value);
}

// "1.#INF", "-1.#IND", "1.#QNAN0": how old Microsoft run-times print what is not finite.
template <typename Real>
bool parse_hash_form(std::string_view word, Real& value) {
  const std::size_t hash = word.find('#');
  if (hash == std::string_view::npos || hash + 2 > word.size()) return false;
  const bool infinite = lower_case(word.substr(hash + 1, 3)) == "inf";
  value = infinite ? std::numeric_limits<Real>::infinity() : std::numeric_limits<Real>::quiet_NaN();
  if (word.front() == '-') value = -value;
  return true;
}

template <typename Real>
bool parse_real(std::string_view word, Real& value) {
  if (word.size() > 1 && word.front() == '+' && word[1] != '-') word.remove_prefix(1);
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  const bool whole = end == word.data() + word.size();
  if (error == std::errc() && whole) return true;
  if (error == std::errc::result_out_of_range && whole) {
    value = saturated<Real>(word);
    return true;
  }
  return parse_hash_form(word, value);
}

template <typename Number>
void append_shortest(std::string& text, Number value) {
  std::array<char, 40> buffer{};
  const auto result = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value);
  text.append(buffer.data(), result.ptr);
}

// Length of the valid UTF-8 sequence at the start of `text` (overlong forms and surrogates are invalid); 0 if
// none.
std::size_t utf8_length(std::string_view text) {
  const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(text[i]); };
  const unsigned char lead = byte(0);
  if (lead < 0x80) return 1;
  const std::size_t length = lead >= 0xF0 ? 4 : lead >= 0xE0 ? 3 : 2;
  if (lead < 0xC2 || lead > 0xF4 || text.size() < length) return 0;
  for (std::size_t i = 1; i < length; ++i) {
    if ((byte(i) & 0xC0) != 0x80) return 0;
  }
  if ((lead == 0xE0 && byte(1) < 0xA0) || (lead == 0xED && byte(1) > 0x9F)) return 0;
  if ((lead == 0xF0 && byte(1) < 0x90) || (lead == 0xF4 && byte(1) > 0x8F)) return 0;
  return length;
}

bool is_control(std::string_view sequence) {
  const auto lead = static_cast<unsigned char>(sequence[0]);
  if (sequence.size() == 2 && lead == 0xC2)
    return static_cast<unsigned char>(sequence[1]) < 0xA0;  // C1 controls
  return lead < 0x20 || lead == 0x7F;
}

}  // namespace

std::size_t size_of(ScalarType type) {
  constexpr std::array<std::size_t, 8> kSizes{1, 1, 2, 2, 4, 4, 4, 8};
  return kSizes[static_cast<std::size_t>(type)];
}

std::string_view type_name(ScalarType type) {
  constexpr std::array<std::string_view, 8> kNames{"int8",  "uint8",  "int16",   "uint16",
                                                   "int32", "uint32", "float32", "float64"};
  return kNames[static_cast<std::size_t>(type)];
}

ScalarAttribute::Values make_values(ScalarType type) {
  switch (type) {
    case ScalarType::kInt8:
      return std::vector<std::int8_t>{};
    case ScalarType::kUint8:
      return std::vector<std::uint8_t>{};
    case ScalarType::kInt16:
      return std::vector<std::int16_t>{};
    case ScalarType::kUint16:
      return std::vector<std::uint16_t>{};
    case ScalarType::kInt32:
      return std::vector<std::int32_t>{};
    case ScalarType::kUint32:
      return std::vector<std::uint32_t>{};
    case ScalarType::kFloat:
      return std::vector<float>{};
    case ScalarType::kDouble:
      break;
  }
  return std::vector<double>{};
}

bool parse_number(std::string_view word, double& value) {
  return parse_real(word, value);
}
bool parse_number(std::string_view word, float& value) {
  return parse_real(word, value);
}

template <typename Integer>
bool parse_integer(std::string_view word, Integer& value) {
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error == std::errc() && end == word.data() + word.size()) return true;
  double real = 0.0;
  if (!parse_real(word, real) || !(std::floor(real) == real)) return false;
  constexpr auto kLowest = static_cast<double>(std::numeric_limits<Integer>::lowest());
  constexpr auto kHighest = static_cast<double>(std::numeric_limits<Integer>::max());
  // 2^64 - 1 rounds up to 2^64 as a double, which is one too many: 64-bit types stop one step before.
  if (real < kLowest || (sizeof(Integer) == 8 ? real >= kHighest : real > kHighest)) return false;
  value = static_cast<Integer>(real);
  return true;
}
template bool parse_integer(std::string_view, std::int8_t&);
template bool parse_integer(std::string_view, std::uint8_t&);
template bool parse_integer(std::string_view, std::int16_t&);
template bool parse_integer(std::string_view, std::uint16_t&);
template bool parse_integer(std::string_view, std::int32_t&);
template bool parse_integer(std::string_view, std::uint32_t&);
template bool parse_integer(std::string_view, std::uint64_t&);

void append_number(std::string& text, double value) {
  append_shortest(text, value);
}
void append_number(std::string& text, float value) {
  append_shortest(text, value);
}
void append_number(std::string& text, std::int64_t value) {
  append_shortest(text, value);
}

bool is_float_text(double value) {
  const auto single = static_cast<float>(value);
  if (static_cast<double>(single) == value || std::isnan(value)) return true;
  if (!std::isfinite(single)) return false;
  std::array<char, 40> buffer{};
  const auto written = std::to_chars(buffer.data(), buffer.data() + buffer.size(), single);
  double again = 0.0;
  std::from_chars(buffer.data(), written.ptr, again);
  return again == value;
}

ScalarAttribute::Values narrowed(std::vector<double> column) {
  if (std::all_of(column.begin(), column.end(), is_float_text))
    return std::vector<float>(column.begin(), column.end());
  return column;
}

std::string clean_text(std::string_view text) {
  std::string result;
  while (!text.empty()) {
    const std::size_t length = utf8_length(text);
    const std::string_view sequence = text.substr(0, length == 0 ? 1 : length);
    if (length == 0 || is_control(sequence)) {
      result += '_';
    } else {
      result += sequence;
    }
    text.remove_prefix(sequence.size());
  }
  return result;
}

std::string clean_name(std::string_view name) {
  std::string result = clean_text(name.substr(0, kLongestName));
  // The cut may have gone through a character, whose rest is then underscores: as good as any other end.
  std::replace(result.begin(), result.end(), ' ', '_');
  if (result.empty()) result += '_';
  return result;
}

std::string quoted(std::string_view piece) {
  constexpr std::size_t kShown = 40;
  std::string result(1, '\'');
  if (!piece.empty()) result += clean_name(piece.substr(0, kShown));
  if (piece.size() > kShown) result += "…";
  result += '\'';
  return result;
}

std::string lower_case(std::string_view text) {
  std::string result(text);
  for (char& c : result) {
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  }
  return result;
}

std::string_view text_of(std::span<const std::byte> bytes) {
  std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  if (text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);
  return text;
}

bool LineReader::next(TextLine& line) {
  if (at_ >= text_.size()) return false;
  std::size_t end = std::min(text_.find('\n', at_), text_.size());
  if (next_cr_ < at_ || next_cr_ == 0) next_cr_ = std::min(text_.find('\r', at_), text_.size());
  end = std::min(end, next_cr_);
  line = {text_.substr(at_, end - at_), ++number_};
  const bool pair = end + 1 < text_.size() && text_[end] == '\r' && text_[end + 1] == '\n';
  at_ = end + (pair ? 2 : 1);
  return true;
}

std::string_view take_word(std::string_view& line) {
  constexpr std::string_view kBlanks = " \t\r\f\v";
  const std::size_t begin = line.find_first_not_of(kBlanks);
  if (begin == std::string_view::npos) {
    line = {};
    return {};
  }
  const std::size_t end = std::min(line.find_first_of(kBlanks, begin), line.size());
  const std::string_view word = line.substr(begin, end - begin);
  line.remove_prefix(end);
  return word;
}

}  // namespace pointwright

#include "engine/io/text.h"

#include <doctest/doctest.h>

#include <cmath>
#include <limits>

namespace pointwright {
namespace {

TEST_CASE("numbers are read exactly and without regard to the locale") {
  double value = 0.0;
  CHECK(parse_number("5648349.895035", value));
  CHECK(value == 5648349.895035);
  CHECK(parse_number("+1.5e3", value));
  CHECK(value == 1500.0);
  CHECK(parse_number("-1.734723475977e-018", value));
  CHECK(value == -1.734723475977e-018);
  float single = 0.0F;
  CHECK(parse_number("16777217", single));  // rounds to even, once
  CHECK(single == 16777216.0F);
}

TEST_CASE("what no number can hold becomes infinite or zero, and odd spellings are known") {
  double value = 0.0;
  CHECK(parse_number("1e999", value));
  CHECK(value == std::numeric_limits<double>::infinity());
  CHECK(parse_number("-1e999", value));
  CHECK(value == -std::numeric_limits<double>::infinity());
  CHECK(parse_number("1e-999", value));
  CHECK(value == 0.0);
  for (const char* word : {"nan", "NaN", "-nan", "1.#QNAN", "-1.#IND"}) {
    CAPTURE(word);
    CHECK(parse_number(word, value));
    CHECK(std::isnan(value));
  }
  for (const char* word : {"inf", "+inf", "Infinity", "1.#INF"}) {
    CAPTURE(word);
    CHECK(parse_number(word, value));
    CHECK(std::isinf(value));
  }
}

TEST_CASE("what is no number is not taken for one") {
  double value = 0.0;
  std::uint8_t byte = 0;
  for (const char* word : {"", "+", "-", ".", "1,5", "1.5x", "0x10", "--1", "+-1", "e5", "#"}) {
    CAPTURE(word);
    CHECK_FALSE(parse_number(word, value));
    CHECK_FALSE(parse_integer(word, byte));
  }
  for (const char* word : {"256", "-1", "1.5", "nan", "inf", "1e300"}) {
    CAPTURE(word);
    CHECK_FALSE(parse_integer(word, byte));
  }
  CHECK(parse_integer("255.0", byte));
  CHECK(byte == 255);
  std::uint64_t wide = 0;
  CHECK_FALSE(parse_integer("1e30", wide));
  CHECK_FALSE(parse_integer("18446744073709551616", wide));
  CHECK(parse_integer("18446744073709551615", wide));
}

TEST_CASE("a number that says no more than a float is told from one that does") {
  for (const double value : {0.1, -0.334708, 0.0, 117.0, 1e-30, 16777216.0}) CHECK(is_float_text(value));
  for (const double value : {5648349.895035, 0.12345678901, 16777217.0, 1e300})
    CHECK_FALSE(is_float_text(value));
}

TEST_CASE("names come out as valid UTF-8 without blanks and control characters") {
  CHECK(clean_name("intensity") == "intensity");
  CHECK(clean_name("höhe") == "höhe");
  CHECK(clean_name("a b\tc\n") == "a_b_c_");
  CHECK(clean_name("\xff\xfe") == "__");
  CHECK(clean_name("\xc0\x80") == "__");            // overlong
  CHECK(clean_name("\xed\xa0\x80") == "___");       // a surrogate
  CHECK(clean_name("\xf4\x90\x80\x80") == "____");  // beyond the last code point
  CHECK(clean_name("\xc2\x85") == "_");             // a C1 control
  CHECK(clean_name("") == "_");
  CHECK(clean_name(std::string(1000, 'x')).size() == 255);
  CHECK(clean_name(clean_name("\xe2\x82")) == clean_name("\xe2\x82"));
}

}  // namespace
}  // namespace pointwright

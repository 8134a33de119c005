#include "protocol/json/parse.h"

#include <doctest/doctest.h>

#include <cmath>
#include <random>

#include "protocol/json/reader.h"

using namespace pointwright;
using namespace pointwright::protocol;

namespace {

JsonErrors refusal(std::string_view text, const ParseLimits& limits = {}) {
  auto document = parse_json(text, limits);
  REQUIRE_MESSAGE(!document.ok(), text);
  return document.errors();
}

std::string nested(std::size_t depth) {
  return std::string(depth, '[') + std::string(depth, ']');
}

}  // namespace

TEST_CASE("well-formed JSON of every kind is parsed") {
  const auto document = parse_json(R"( {"a": [1, -2, 3.5e2, true, false, null], "b": {"c": "\u00e9\n"}} )");
  REQUIRE(document.ok());
  CHECK(document.value()["a"][2].get<double>() == 350.0);
  CHECK(document.value()["b"]["c"].get<std::string>() == "\u00e9\n");
  CHECK(parse_json("0").ok());
  CHECK(parse_json("\"\"").ok());
}

TEST_CASE("what is not JSON is malformed, with the place") {
  for (const char* text : {"",
                           " ",
                           "{",
                           "[1,]",
                           "{\"a\":}",
                           "{\"a\" 1}",
                           "{a:1}",
                           "'a'",
                           "NaN",
                           "Infinity",
                           "-",
                           "01",
                           "1 2",
                           "[1] x",
                           "nul",
                           "\"\x01\"",
                           "\"\xff\"",
                           "\"\xc3\"",
                           "\"\xed\xa0\x80\"",
                           "/*c*/1",
                           "\"\\ud800\"",
                           "\x00"}) {
    CAPTURE(text);
    CHECK(refusal(text).kind == JsonErrorKind::kMalformed);
  }
  CHECK(refusal(std::string_view("1\0", 2)).kind == JsonErrorKind::kMalformed);
  CHECK(refusal("[1, 2, x]").faults.front().detail == "malformed JSON at byte 8");
}

TEST_CASE("nesting up to 32 levels passes, one more is refused, and a hundred thousand do no harm") {
  CHECK(parse_json(nested(32)).ok());
  CHECK(refusal(nested(33)).kind == JsonErrorKind::kInvalid);
  CHECK(refusal(nested(100'000)).kind == JsonErrorKind::kInvalid);
  std::string objects;
  for (int i = 0; i < 50'000; ++i) objects += "{\"a\":";
  CHECK(refusal(objects).fault_count == 1);
}

TEST_CASE("repeated members are refused where they stand") {
  const JsonErrors errors = refusal(R"({"x": [0, {"a": 1, "b": 2, "a": 3}]})");
  CHECK(errors.kind == JsonErrorKind::kInvalid);
  CHECK(errors.faults.front().pointer == "/x/1/a");
  CHECK(refusal(R"({"a":1,"\u0061":2})").faults.front().pointer == "/a");
  CHECK(parse_json(R"({"a":{"a":1},"b":{"a":1}})").ok());
}

TEST_CASE("numbers beyond float64 are refused, not turned into infinity") {
  const JsonErrors errors = refusal(R"({"a":[1,1e999]})");
  CHECK(errors.kind == JsonErrorKind::kInvalid);
  CHECK(errors.faults.front().pointer == "/a/1");
  CHECK(refusal("-1e400").kind == JsonErrorKind::kInvalid);
  CHECK(parse_json("1e-999").ok());
}

TEST_CASE("too many bytes and too many values are refused with the limit") {
  const JsonErrors large = refusal("[1,2,3]", {.max_bytes = 6});
  CHECK(large.kind == JsonErrorKind::kTooLarge);
  CHECK(large.limit == 6);
  CHECK(large.actual == 7);
  CHECK(parse_json("[1,2,3]", {.max_bytes = 7}).ok());
  const JsonErrors many = refusal("[1,2,3]", {.max_values = 3});
  CHECK(many.kind == JsonErrorKind::kInvalid);
  CHECK(many.limit == 3);
  CHECK(parse_json("[1,2,3]", {.max_values = 4}).ok());
}

TEST_CASE("mutants of a request never do worse than a refusal") {
  const std::string whole =
      R"({"mode":"add","shape":{"type":"stroke","vertices":[[0,1,2],[3,4,5.5]],"radius":1e-3}})";
  std::mt19937 random(5);
  for (int round = 0; round < 5000; ++round) {
    std::string mutant = whole;
    for (int change = 0; change < 3; ++change) {
      mutant[random() % mutant.size()] = static_cast<char>(random() % 256);
    }
    const auto document = parse_json(mutant);
    if (!document.ok()) CHECK_FALSE(document.errors().summary().empty());
  }
}

TEST_CASE("pointers escape and shorten names from outside") {
  CHECK(child_pointer("/a", "b/c~d") == "/a/b~1c~0d");
  CHECK(child_pointer("", std::size_t{7}) == "/7");
  CHECK(child_pointer("", std::string(1000, 'x')).size() == 65);
  // 21 three-byte characters fill 63 of the 64 bytes: none is cut in half.
  std::string euros;
  for (int i = 0; i < 100; ++i) euros += "\u20ac";
  CHECK(child_pointer("", euros).size() == 1 + 63);
}

TEST_CASE("only as many faults are listed as a person reads, and the rest are counted") {
  JsonErrors errors;
  for (int i = 0; i < 100; ++i) errors.add("/x", "wrong");
  CHECK(errors.faults.size() == JsonErrors::kMaxFaults);
  CHECK(errors.fault_count == 100);
  CHECK(errors.summary() == "/x: wrong (and 99 more faults)");
}

TEST_CASE("a checked number is of the right type, finite and in range") {
  const auto faults = [](const Json& value, const NumberRange& range = {}) {
    JsonErrors errors;
    const auto number = read_number(value, "/n", errors, range);
    CHECK(number.has_value() == errors.empty());
    return errors.fault_count;
  };
  CHECK(faults(1.5) == 0);
  CHECK(faults(-3) == 0);
  CHECK(faults(true) == 1);
  CHECK(faults("1") == 1);
  CHECK(faults(nullptr) == 1);
  CHECK(faults(Json::array({1})) == 1);
  CHECK(faults(std::numeric_limits<double>::infinity()) == 1);
  CHECK(faults(std::nan("")) == 1);
  CHECK(faults(0.2, {.min = 0.0, .max = 0.2}) == 0);
  CHECK(faults(0.2000001, {.min = 0.0, .max = 0.2}) == 1);
}

TEST_CASE("a checked whole number neither wraps nor loses a fraction") {
  const auto read = [](const Json& value, std::uint64_t max) {
    JsonErrors errors;
    const auto number = read_integer(value, "/n", errors, 1, max);
    CHECK(number.has_value() == errors.empty());
    return number;
  };
  CHECK(read(7, 10) == 7);
  CHECK(read(7.0, 10) == 7);
  constexpr std::uint64_t kMaxExact = std::uint64_t{1} << 53;
  CHECK(read(kMaxExact, kMaxExact) == kMaxExact);
  for (const Json& wrong :
       {Json(-1), Json(0), Json(11), Json(1.9), Json(true), Json("7"), Json(nullptr), Json(4294967297),
        Json(1e300), Json(-1e300), Json(std::numeric_limits<std::int64_t>::min()),
        Json(std::numeric_limits<std::uint64_t>::max())}) {
    CAPTURE(wrong.dump());
    CHECK_FALSE(read(wrong, 10).has_value());
  }
}

TEST_CASE("an object reports members that are missing or unknown") {
  JsonErrors errors;
  const Json value{{"a", 1}, {"b", nullptr}, {"colour", 2}};
  ObjectReader object(value, "/o", errors);
  CHECK(object.required("a") != nullptr);
  CHECK(object.optional("b") != nullptr);
  CHECK(object.optional("c") == nullptr);
  CHECK(errors.empty());
  CHECK(object.required("d") == nullptr);
  object.finish();
  REQUIRE(errors.faults.size() == 2);
  CHECK(errors.faults[0].pointer == "/o/d");
  CHECK(errors.faults[1].pointer == "/o/colour");
  JsonErrors not_an_object;
  ObjectReader array(Json::array(), "", not_an_object);
  CHECK(array.required("a") == nullptr);
  array.finish();
  CHECK(not_an_object.fault_count == 1);
}

#include "engine/core/result.h"

#include <doctest/doctest.h>

#include <memory>
#include <string>

namespace pointwright {
namespace {

Error some_error() {
  return Error{.code = ErrorCode::kTooLarge, .message = "too much", .field = "x", .limit = 3, .actual = 4};
}

TEST_CASE("a result holds its value") {
  Result<std::string> result = std::string("hello");
  CHECK(result.ok());
  CHECK(static_cast<bool>(result));
  CHECK(result.value() == "hello");
  result.value() += "!";
  CHECK(std::move(result).value() == "hello!");
}

TEST_CASE("a result holds its error with everything in it") {
  const Result<int> result = some_error();
  CHECK_FALSE(result.ok());
  CHECK(result.error().code == ErrorCode::kTooLarge);
  CHECK(result.error().message == "too much");
  CHECK(result.error().field == "x");
  CHECK(result.error().limit == 3.0);
  CHECK(result.error().actual == 4.0);
}

TEST_CASE("reading the wrong side of a result is a logic error") {
  const Result<int> failed = some_error();
  const Result<int> fine = 7;
  CHECK_THROWS_AS((void)failed.value(), LogicError);
  CHECK_THROWS_AS((void)fine.error(), LogicError);
  const Result<void> done;
  CHECK(done.ok());
  CHECK_THROWS_AS((void)done.error(), LogicError);
  const Result<void> not_done = some_error();
  CHECK_FALSE(not_done.ok());
  CHECK(not_done.error().code == ErrorCode::kTooLarge);
}

TEST_CASE("a result carries what can only be moved") {
  Result<std::unique_ptr<int>> result = std::make_unique<int>(5);
  const std::unique_ptr<int> value = std::move(result).value();
  CHECK(*value == 5);
}

TEST_CASE("a broken check names its condition, its message and its place") {
  try {
    POINTWRIGHT_CHECK(1 + 1 == 3, "arithmetic holds");
    FAIL("the check must throw");
  } catch (const LogicError& error) {
    const std::string what = error.what();
    CHECK(what.find("1 + 1 == 3") != std::string::npos);
    CHECK(what.find("arithmetic holds") != std::string::npos);
    CHECK(what.find("result_test.cpp:") != std::string::npos);
  }
}

}  // namespace
}  // namespace pointwright

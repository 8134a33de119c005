#include "engine/core/execution_context.h"

#include <doctest/doctest.h>

namespace pointwright {
namespace {

TEST_CASE("copies of a context share cancel and progress") {
  const ExecutionContext context;
  const ExecutionContext copy = context;  // NOLINT(performance-unnecessary-copy-initialization)
  CHECK_FALSE(copy.is_cancelled());
  context.cancel();
  CHECK(copy.is_cancelled());
  copy.begin_phase("normals", 0.25);
  CHECK(context.progress().phase == "normals");
  CHECK(context.progress().fraction == 0.25);
  CHECK_FALSE(ExecutionContext().is_cancelled());
}

TEST_CASE("progress never decreases") {
  const ExecutionContext context;
  context.begin_phase("one", 0.5);
  context.begin_phase("two", 0.25);
  CHECK(context.progress().phase == "two");
  CHECK(context.progress().fraction == 0.5);
}

TEST_CASE("cancelled work has an error of its own") {
  CHECK(cancelled_error().code == ErrorCode::kCancelled);
}

}  // namespace
}  // namespace pointwright

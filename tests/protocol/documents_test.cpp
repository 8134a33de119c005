#include "protocol/json/documents.h"

#include <doctest/doctest.h>

#include <fstream>
#include <iterator>
#include <limits>
#include <set>

using namespace pointwright;
using namespace pointwright::protocol;

namespace {

std::string read_file(const std::string& path) {
  std::ifstream in(std::string(POINTWRIGHT_SOURCE_DIR "/protocol/").append(path), std::ios::binary);
  REQUIRE_MESSAGE(in, path);
  return {std::istreambuf_iterator<char>(in), {}};
}

constexpr std::array kErrorCodes{ErrorCode::kInvalidArgument,   ErrorCode::kMalformedData,
                                 ErrorCode::kUnsupportedFormat, ErrorCode::kNonFinite,
                                 ErrorCode::kOutOfRange,        ErrorCode::kTooLarge,
                                 ErrorCode::kEmptyCloud,        ErrorCode::kEmptyRegion,
                                 ErrorCode::kRegionsIntersect,  ErrorCode::kCancelled};

}  // namespace

TEST_CASE("the table of problems has one row for each kind, in order, with a slug of its own") {
  std::set<std::string_view> slugs;
  int index = 0;
  for (const ProblemInfo& info : all_problems()) {
    CAPTURE(info.slug);
    CHECK(static_cast<int>(info.kind) == index++);
    CHECK(&problem_info(info.kind) == &info);
    CHECK(find_problem(info.slug) == &info);
    CHECK(info.status >= 400);
    CHECK(info.status < 600);
    CHECK_FALSE(info.title.empty());
    CHECK(info.explanation.ends_with('.'));
    CHECK(info.slug.find_first_not_of("abcdefghijklmnopqrstuvwxyz-") == std::string_view::npos);
    slugs.insert(info.slug);
  }
  CHECK(slugs.size() == all_problems().size());
  CHECK(all_problems().back().kind == ProblemKind::kCancelled);
  CHECK(find_problem("no-such-problem") == nullptr);
}

TEST_CASE("every error of the engine is a client's problem of its own, none of them ours") {
  std::set<ProblemKind> kinds;
  for (const ErrorCode code : kErrorCodes) {
    const Problem problem = to_problem(Error{.code = code, .message = "m", .field = "shape.radius"});
    CHECK(problem.status() < 500);
    CHECK(problem.detail == "m");
    REQUIRE(problem.errors.size() == 1);
    CHECK(problem.errors[0].pointer == "/shape/radius");
    kinds.insert(problem.kind);
  }
  CHECK(kinds.size() == kErrorCodes.size());
  CHECK_THROWS_AS((void)problem_of(static_cast<ErrorCode>(kErrorCodes.size())), LogicError);
}

TEST_CASE("openapi.yaml lists every problem") {
  const std::string yaml = read_file("openapi.yaml");
  for (const ProblemInfo& info : all_problems()) {
    CHECK_MESSAGE(yaml.find("- /problems/" + std::string(info.slug) + "\n") != std::string::npos, info.slug);
  }
}

TEST_CASE("a problem document has the members of RFC 9457 and ours, in order") {
  const Problem problem{.kind = ProblemKind::kTooManySamples,
                        .detail = "d",
                        .instance = "/v1/clouds",
                        .request_id = "r",
                        .errors = {{"/a", "b"}},
                        .limit = 2.0,
                        .actual = 2.5,
                        .revision = 3};
  CHECK(
      to_text(to_json(problem)) ==
      R"({"type":"/problems/limit-exceeded","title":"A limit is exceeded","status":413,"detail":"d",)"
      R"("instance":"/v1/clouds","request_id":"r","errors":[{"pointer":"/a","detail":"b"}],"limit":2,"actual":2.5,"revision":3})");
}

TEST_CASE("refused JSON becomes the right problem") {
  CHECK(to_problem(parse_json("{").errors()).status() == 400);
  CHECK(to_problem(parse_json("[1]", {.max_bytes = 1}).errors()).status() == 413);
  const Problem invalid = to_problem(parse_json(R"({"a":1,"a":2})").errors());
  CHECK(invalid.status() == 422);
  REQUIRE(invalid.errors.size() == 1);
  CHECK(invalid.errors[0].pointer == "/a");
}

TEST_CASE("engine fields become pointers into the request") {
  CHECK(pointer_of_field("") == "");
  CHECK(pointer_of_field("scales") == "/scales");
  CHECK(pointer_of_field("shape.vertices[3]") == "/shape/vertices/3");
  CHECK(pointer_of_field("deformation.angle_rad") == "/deformation/angle_deg");
}

TEST_CASE("numbers of documents are finite, floats short, times exact, text always UTF-8") {
  CHECK_THROWS_AS((void)checked_number(std::numeric_limits<double>::infinity()), LogicError);
  CHECK_THROWS_AS((void)checked_number(std::numeric_limits<float>::quiet_NaN()), LogicError);
  CHECK(checked_number(0.02F) == 0.02);
  CHECK(checked_number(-1e-30F) == -1e-30);
  CHECK(to_rfc3339(TimePoint{}) == "1970-01-01T00:00:00.000Z");
  CHECK(to_rfc3339(TimePoint{} + std::chrono::milliseconds(951'827'696'007)) == "2000-02-29T12:34:56.007Z");
  CHECK(to_text(JsonDocument{{"a", "\xff"}}) == "{\"a\":\"\xef\xbf\xbd\"}");
  CHECK(to_text(JsonDocument{{"a", "\n"}}).find('\n') == std::string::npos);
}

TEST_CASE("the examples of requests pass their parsers and come back the same") {
  const auto document = [](const std::string& name) {
    return parse_json(read_file("examples/" + name + ".json")).value();
  };
  for (const char* name :
       {"operation-sphere", "operation-stroke", "operation-box", "operation-half-space", "operation-all",
        "operation-points", "operation-invert", "operation-grow", "operation-screen", "operation-visible",
        "operation-flood", "operation-image", "operation-texture", "operation-model", "operation-region"}) {
    CAPTURE(name);
    const Json example = document(name);
    const auto operation = parse_paint_operation(example);
    REQUIRE(operation.ok());
    CHECK(Json::parse(to_json(operation.value()).dump()) == example);
  }
  for (const char* name : {"edit-translation", "edit-rotation", "edit-along-normal", "edit-resampling",
                           "edit-scale", "edit-sequence", "edit-toward-point", "edit-twist"}) {
    CAPTURE(name);
    const Json example = document(name);
    const auto edit = parse_edit(example);
    REQUIRE(edit.ok());
    CHECK(Json::parse(to_json(edit.value()).dump()) == example);
  }
  CHECK(parse_painting(document("painting-request")).ok());
  CHECK(parse_preview(document("preview")).value().sequence == 42);
  CHECK(parse_create_session(document("create-session")).value().name == "Wings up");
  CHECK(parse_head(document("head")).value().edit == 0);
  CHECK(parse_session_change(document("session-change")).value().name == "arm, bent");
  const auto import = parse_import_cloud(document("import-cloud"));
  REQUIRE(import.ok());
  CHECK(import.value().upload == "u7k8l9m0n1o2p-q_r3s4t5");
  CHECK(import.value().name == "The yard");
  CHECK(import.value().drop_non_finite);
  CHECK(import.value().format == CloudFormat::kLas);
}

TEST_CASE("an import that names no upload, or says more or else than it may, is refused where it does") {
  const auto fault = [](const char* text) {
    const auto parsed = parse_import_cloud(Json::parse(text));
    REQUIRE_FALSE(parsed.ok());
    return parsed.errors().faults.front().pointer;
  };
  CHECK(fault(R"({})") == "/upload");
  CHECK(fault(R"({"upload":"x"})") == "/upload");
  CHECK(fault(R"({"upload":"u7k8l9m0n1o2p-q_r3s4t5","format":"laz"})") == "/format");
  CHECK(fault(R"({"upload":"u7k8l9m0n1o2p-q_r3s4t5","nonfinite":true})") == "/nonfinite");
  CHECK(fault(R"({"upload":"u7k8l9m0n1o2p-q_r3s4t5","name":""})") == "/name");
  CHECK(fault(R"({"upload":"u7k8l9m0n1o2p-q_r3s4t5","more":1})") == "/more");
}

TEST_CASE("what the server sends of paintings and edits passes the parsers of requests") {
  const Json painting = parse_json(read_file("examples/painting.json")).value();
  CHECK(parse_painting(Json{{"operations", painting["operations"]}}).ok());
  const Json list = parse_json(read_file("examples/edit-list.json")).value();
  for (const Json& record : list["edits"]) {
    CHECK(parse_edit(record["edit"]).ok());
  }
}

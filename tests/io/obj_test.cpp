#include <doctest/doctest.h>

#include "tests/io/io_support.h"

namespace pointwright::io_test {
namespace {

ImportedCloud read(std::string_view text) {
  return read_text(text, CloudFormat::kObj);
}
ErrorCode code_of(std::string_view text, const ImportParams& params = {}) {
  return error_of(text, CloudFormat::kObj, params).code;
}

TEST_CASE("OBJ: vertices come in order, faces are counted and left out") {
  for (const std::string end : {"\n", "\r\n", "\r"}) {
    CAPTURE(end.size());
    const ImportedCloud read_back =
        read("# a mesh" + end + "o thing" + end + "v 1 2 3" + end + "v 4 5 6 # last" + end + "vt 0 0" + end +
             "usemtl m" + end + "f 1 2 1" + end + "f 2/1 1/1 2/1" + end);
    const Cloud cloud = in_caller_order(read_back.cloud);
    REQUIRE(cloud.size() == 2);
    CHECK(model_position(cloud, 0) == Vec3d(1, 2, 3));
    CHECK(model_position(cloud, 1) == Vec3d(4, 5, 6));
    CHECK_FALSE(cloud.position_is_double);
    CHECK(read_back.report.format == CloudFormat::kObj);
    CHECK(read_back.report.from_mesh);
    CHECK(read_back.report.skipped == std::vector<std::string>{"2 faces", "texture coordinates"});
  }
}

TEST_CASE("OBJ: numbers of float64 stay so, to the bit; a backslash joins lines") {
  const Cloud cloud =
      in_caller_order(read("v 500000.123 \\\n4649776.456 12.5\nv 500001.5 \\\n  4649777 \\\n 1\n").cloud);
  CHECK(cloud.position_is_double);
  CHECK(model_position(cloud, 0) == Vec3d(500000.123, 4649776.456, 12.5));
  CHECK(model_position(cloud, 1) == Vec3d(500001.5, 4649777, 1));
}

TEST_CASE("OBJ: colours become bytes where that loses nothing") {
  const Cloud fractions = in_caller_order(read("v 0 0 0 1 0 0.501961\nv 1 0 0 0.004 0.0039216 0\n").cloud);
  REQUIRE(fractions.has_colors());
  CHECK(fractions.color[0] == Rgba{255, 0, 128, 255});
  CHECK(fractions.color[1] == Rgba{1, 1, 0, 255});
  CHECK_FALSE(fractions.color_has_alpha);
  const Cloud bytes = in_caller_order(read("v 0 0 0 255 0 7\nv 1 0 0 1 1 0\n").cloud);
  REQUIRE(bytes.has_colors());
  CHECK(bytes.color[0] == Rgba{255, 0, 7, 255});
  const Cloud wide = read("v 0 0 0 0.123456 2.5 0\nv 1 0 0 0 0 0\n").cloud;
  CHECK_FALSE(wide.has_colors());
  REQUIRE(wide.scalars.size() == 3);
  CHECK(wide.scalars[1].name == "green");
}

TEST_CASE("OBJ: normals count where there is one for each vertex; weights where they say something") {
  const ImportedCloud paired = read("v 0 0 0\nv 1 0 0\nvn 0 0 2\nvn 0 1 0\n");
  REQUIRE(paired.cloud.has_normals());
  CHECK(in_caller_order(paired.cloud).normal[0] == Vec3f(0, 0, 1));
  CHECK(paired.report.normals == NormalQuality::kScaled);
  const ImportedCloud odd = read("v 0 0 0 1\nv 1 0 0 1\nvn 0 0 1\n");
  CHECK_FALSE(odd.cloud.has_normals());
  CHECK(odd.cloud.scalars.empty());
  CHECK(odd.report.skipped.front().find("1 normals") == 0);
  CHECK(read("v 0 0 0 1\nv 1 0 0 2\n").cloud.scalars.front().name == "w");
}

TEST_CASE("OBJ: what is wrong is said with its line") {
  CHECK(code_of("# nothing\nf 1 2 3\n") == ErrorCode::kEmptyCloud);
  for (const char* text : {"v 1 2\n", "v 1 2 x\n", "v 1 2 3\nv 1 2 3 4\n", "v 1 2 3 4 5\n",
                           "v 1 2 3\nvn 1 2\n", "v 1 2 3 4 5 6 7 8\n", "v\n", "v \\"}) {
    CAPTURE(text);
    CHECK(code_of(text) == ErrorCode::kMalformedData);
  }
  CHECK(error_of("v 1 2 3\n\nv 1 b 3\n", CloudFormat::kObj).message.find("line 3") != std::string::npos);
  CHECK(code_of("v 1 2 3\nv 1 2 4\nv 1 2 5\n", {.max_samples = 2}) == ErrorCode::kTooLarge);
  CHECK(code_of("v 1 nan 3\n") == ErrorCode::kNonFinite);
  CHECK(read_text("v 1 nan 3\nv 1 2 3\n", CloudFormat::kObj, {.drop_non_finite = true})
            .report.dropped_non_finite == 1);
}

}  // namespace
}  // namespace pointwright::io_test

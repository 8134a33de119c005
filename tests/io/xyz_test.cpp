#include <doctest/doctest.h>

#include "tests/io/io_support.h"

namespace pointwright::io_test {
namespace {

Cloud read(std::string_view text) {
  return in_caller_order(read_text(text, CloudFormat::kXyz).cloud);
}

TEST_CASE("columns may be parted by blanks, tabs, commas or semicolons, lines end as they like") {
  const Cloud expected = read("1 2 3\n4 5 6\n");
  for (const char* text : {"1,2,3\n4,5,6", "1;2;3\r\n4;5;6\r\n", "  1\t2  3 \r4, 5, 6\r",
                           "\xEF\xBB\xBF"
                           "1 2 3\n\n4 5 6",
                           "# comment\n1 2 3\n// other\n4 5 6 # tail\n", "2\n1 2 3\n4 5 6\n",
                           "X Y Z\n1 2 3\n4 5 6", "//X Y Z\n1 2 3\n4 5 6", "% x y z\n2\n1 2 3\n4 5 6"}) {
    CAPTURE(text);
    CHECK(difference(read(text), expected) == "");
  }
}

TEST_CASE("six columns are a unit normal, or bytes of colour, or two more scalars each") {
  const Cloud normals = read("1 2 3 0 0 1\n4 5 6 0.6 0 0.8\n");
  CHECK(normals.has_normals());
  CHECK(normals.normal[1].isApprox(Vec3f(0.6F, 0, 0.8F)));
  const Cloud colors = read("1 2 3 255 0 7\n4 5 6 1 2 3\n");
  CHECK(colors.color == std::vector<Rgba>{{255, 0, 7, 255}, {1, 2, 3, 255}});
  const Cloud neither = read("1 2 3 0.5 0 7\n4 5 6 1 2 3\n");
  REQUIRE(neither.scalars.size() == 3);
  CHECK(neither.scalars[0].name == "column_4");
  const Cloud both = read("1 2 3 0 0 1 10 20 30\n4 5 6 0 1 0 11 21 31\n");
  CHECK((both.has_normals() && both.has_colors()));
  const Cloud turned = read("1 2 3 10 20 30 0 0 1\n4 5 6 11 21 31 0 1 0\n");
  CHECK((turned.has_normals() && turned.has_colors()));
}

TEST_CASE("names in the first line or a comment decide over guesses") {
  const Cloud cloud = read("//Z Y X Intensity R G B\n3 2 1 0.5 9 8 7\n6 5 4 0.25 1 2 3\n");
  CHECK(model_position(cloud, 0) == Vec3d(1, 2, 3));
  CHECK(cloud.color[0] == Rgba{9, 8, 7, 255});
  CHECK(cloud.scalars == std::vector<ScalarAttribute>{{"Intensity", std::vector<float>{0.5F, 0.25F}}});
  CHECK(read("x,y,z,nx,ny,nz\n1,2,3,0,0,2\n").normal[0] == Vec3f(0, 0, 1));
}

TEST_CASE("numbers with more digits than float32 has are kept as float64") {
  const ImportedCloud far =
      read_text("665187.522077 5648349.895035 241.767693\n665180.4 5648347.1 241.9\n", CloudFormat::kXyz);
  CHECK(far.cloud.position_is_double);
  CHECK(model_position(in_caller_order(far.cloud), 0) == Vec3d(665187.522077, 5648349.895035, 241.767693));
  CHECK_FALSE(read("0.1 -0.334708 1e-3\n1 2 3").position_is_double);
}

TEST_CASE("positions, normals, colours and scalars come back from XYZ") {
  for (const Place place : {Place::kNearZero, Place::kFarFloat, Place::kFarDouble}) {
    Cloud cloud = cloud_with_everything(200, place).cloud;
    std::erase_if(cloud.scalars, [](const ScalarAttribute& s) { return s.name != "gps_time"; });
    // NaN has one spelling in text: its sign and payload are not kept.
    Cloud again = through(cloud, CloudFormat::kXyz).cloud;
    CHECK(difference(again, cloud) == "");
  }
  const Cloud plain = sphere(50).cloud;
  const auto text = text_of(write_cloud(plain, CloudFormat::kXyz, {}).value());
  CHECK(text.find('#') == std::string::npos);
  CHECK(difference(through(plain, CloudFormat::kXyz).cloud, plain) == "");
}

TEST_CASE("integers come back from XYZ by value") {
  Cloud cloud = sphere(4).cloud;
  cloud.scalars = {{"label", std::vector<std::int32_t>{-5, 2147483647, 0, 7}}};
  const Cloud again = through(cloud, CloudFormat::kXyz).cloud;
  CHECK(std::get<std::vector<double>>(again.scalars[0].values) == std::vector<double>{-5, 2147483647, 0, 7});
}

TEST_CASE("lines that are no rows are refused with their number") {
  const auto code = [](std::string_view text) { return error_of(text, CloudFormat::kXyz).code; };
  for (const char* text :
       {"1 2\n", "1 2 3\n4 5\n", "1 2 3\n4 5 6 7\n", "1 2 3\nx y z\n", "1 2 x\n", "a b c\nd e f\n",
        "3\n1 2 3\n4 5 6\n", "1\n1 2 3\n4 5 6\n", "49000000\n1 2 3\n", "1 2 3\n1e5000x 2 3\n"}) {
    CAPTURE(text);
    CHECK(code(text) == ErrorCode::kMalformedData);
  }
  CHECK(error_of("1 2 3\n4 5\n", CloudFormat::kXyz).message.find("line 2") != std::string::npos);
  for (const char* text : {"# nothing\n", "\n\n", "0\n", "x y z\n"})
    CHECK(code(text) == ErrorCode::kEmptyCloud);
  CHECK(code("1000000000000\n1 2 3\n") == ErrorCode::kTooLarge);
  CHECK(error_of("1 2 3\n1 2 4\n1 2 5\n", CloudFormat::kXyz, {.max_samples = 2}).code ==
        ErrorCode::kTooLarge);
  std::string wide;
  for (int i = 0; i < 300; ++i) wide += "1 ";
  CHECK(code(wide) == ErrorCode::kMalformedData);
}

}  // namespace
}  // namespace pointwright::io_test

#include <doctest/doctest.h>

#include "tests/io/io_support.h"

namespace pointwright::io_test {
namespace {

Result<CloudFormat> detect(std::string_view text) {
  return detect_format(bytes_of(text));
}

TEST_CASE("formats are known by their first bytes") {
  CHECK(detect("ply\nformat ascii 1.0\n").value() == CloudFormat::kPly);
  CHECK(detect("ply\r\nformat").value() == CloudFormat::kPly);
  CHECK(detect("ply\rformat").value() == CloudFormat::kPly);
  CHECK(detect(std::string_view("DRACO\x02\x03\0\0\0\0", 11)).value() == CloudFormat::kDraco);
  CHECK(detect("1 2 3\n4 5 6\n").value() == CloudFormat::kXyz);
  CHECK(detect("1,2,3\r\n").value() == CloudFormat::kXyz);
  CHECK(detect("\xEF\xBB\xBF-1e3;2;3").value() == CloudFormat::kXyz);
  CHECK(detect("# a comment\n\n// another\n2\n1 2 3\n4 5 6").value() == CloudFormat::kXyz);
  CHECK(detect("X Y Z\n1 2 3").value() == CloudFormat::kXyz);
  CHECK(detect(std::string_view("LASF\0\0", 6)).value() == CloudFormat::kLas);
  CHECK(detect("# .PCD v0.7\nVERSION 0.7").value() == CloudFormat::kPcd);
  CHECK(detect("VERSION .7\nFIELDS x y z").value() == CloudFormat::kPcd);
  CHECK(detect("v 1 2 3\n").value() == CloudFormat::kObj);
  CHECK(detect("# made by\n\nmtllib a.mtl\nv 1 2 3\n").value() == CloudFormat::kObj);
}

TEST_CASE("what is for other programs is refused with advice") {
  CHECK(detect("").error().code == ErrorCode::kEmptyCloud);
  for (const std::string_view text :
       {std::string_view("ASTM-E57"), std::string_view("OFF\n8 6 0\n"), std::string_view("\x1f\x8b\x08"),
        std::string_view("PK\x03\x04"), std::string_view("glTF\x02"), std::string_view("v x\n"),
        std::string_view("plywood"), std::string_view("hello"), std::string_view("1 2\n"),
        std::string_view("1 2 3\0", 6), std::string_view("<html>")}) {
    CAPTURE(text);
    REQUIRE_FALSE(detect(text).ok());
    CHECK(detect(text).error().code == ErrorCode::kUnsupportedFormat);
  }
  CHECK(detect("\x1f\x8b\x08").error().message.find("gzip") != std::string::npos);
  CHECK(detect("ASTM-E57").error().message.find("CloudCompare") != std::string::npos);
}

TEST_CASE("a writer refuses what its format cannot hold instead of leaving it out") {
  const Cloud cloud = sphere(20).cloud;
  CHECK(write_cloud(Cloud{}, CloudFormat::kPly, {}).error().code == ErrorCode::kEmptyCloud);
  CHECK(write_cloud(cloud, CloudFormat::kDraco, {.draco_position_bits = 7}).error().code ==
        ErrorCode::kInvalidArgument);
  CHECK(write_cloud(cloud, CloudFormat::kDraco, {.draco_position_bits = 31}).error().code ==
        ErrorCode::kInvalidArgument);
  CHECK(write_cloud(cloud, CloudFormat::kDraco, {.ascii = true}).error().code == ErrorCode::kInvalidArgument);
  CHECK(write_cloud(cloud, CloudFormat::kPly, {.draco_position_bits = 12}).error().code ==
        ErrorCode::kInvalidArgument);
  CHECK(write_cloud(cloud, CloudFormat::kXyz, {.draco_position_bits = 12}).error().code ==
        ErrorCode::kUnsupportedFormat);
  CHECK(write_cloud(cloud, CloudFormat::kObj, {}).error().code == ErrorCode::kUnsupportedFormat);
  CHECK(write_cloud(cloud, CloudFormat::kPcd, {}).error().code == ErrorCode::kUnsupportedFormat);
  CHECK(write_cloud(cloud, CloudFormat::kLas, {.ascii = true}).error().code == ErrorCode::kInvalidArgument);
  Cloud torn = cloud;
  torn.id.pop_back();
  CHECK(write_cloud(torn, CloudFormat::kPly, {}).error().code == ErrorCode::kMalformedData);
}

}  // namespace
}  // namespace pointwright::io_test

#include <doctest/doctest.h>

#include <bit>
#include <cmath>
#include <cstring>
#include <limits>

#include "engine/io/ply.h"
#include "tests/io/io_support.h"

namespace pointwright::io_test {
namespace {

// A binary row, in either byte order.
class Row {
 public:
  explicit Row(bool big) : big_(big) {}
  template <typename T>
  Row& put(T value) {
    auto raw = std::bit_cast<std::array<char, sizeof(T)>>(value);
    if (big_) std::reverse(raw.begin(), raw.end());
    bytes_.append(raw.data(), raw.size());
    return *this;
  }
  [[nodiscard]] const std::string& bytes() const { return bytes_; }

 private:
  bool big_;
  std::string bytes_;
};

const char* const kMixedHeader =
    "element camera 1\nproperty list uchar float row\nproperty double zoom\n"
    "element vertex 2\n"
    "property short intensity\nproperty uint8 blue\nproperty list ushort int neighbours\nproperty double z\n"
    "property float64 x\nproperty uchar red\nproperty double y\nproperty uchar green\nproperty int8 tiny\n"
    "property uint32 stamp\nproperty float32 weight\n"
    "element face 1\nproperty list uint8 int32 vertex_indices\nend_header\n";

std::string mixed(const std::string& format, const std::string& body) {
  return "ply\nformat " + format + " 1.0\ncomment made by a test\nobj_info nothing\n" + kMixedHeader + body;
}

std::string mixed_binary(bool big) {
  Row row(big);
  row.put<std::uint8_t>(2).put<float>(1).put<float>(2).put<double>(35.0);
  row.put<std::int16_t>(-5).put<std::uint8_t>(30).put<std::uint16_t>(1).put<std::int32_t>(1).put<double>(
      3.25);
  row.put<double>(1.25).put<std::uint8_t>(10).put<double>(2.25).put<std::uint8_t>(20).put<std::int8_t>(-128);
  row.put<std::uint32_t>(4000000000U).put<float>(0.5F);
  row.put<std::int16_t>(7).put<std::uint8_t>(33).put<std::uint16_t>(0).put<double>(6.5);
  row.put<double>(4.5).put<std::uint8_t>(11).put<double>(5.5).put<std::uint8_t>(22).put<std::int8_t>(127);
  row.put<std::uint32_t>(1).put<float>(0.25F);
  row.put<std::uint8_t>(3).put<std::int32_t>(0).put<std::int32_t>(1).put<std::int32_t>(0);
  return mixed(big ? "binary_big_endian" : "binary_little_endian", row.bytes());
}

const char* const kMixedAscii =
    "2 1 2 35\n"
    "-5 30 1 1 3.25 1.25 10 2.25 20 -128 4000000000 0.5\n"
    "7 33 0 6.5 4.5 11 5.5 22 127 1 0.25\n"
    "3 0 1 0\n";

TEST_CASE("properties in any order and of any type find their place, in all three encodings") {
  for (const std::string& file : {mixed("ascii", kMixedAscii), mixed_binary(false), mixed_binary(true)}) {
    const ImportedCloud read = read_text(file, CloudFormat::kPly);
    const Cloud cloud = in_caller_order(read.cloud);
    REQUIRE(cloud.size() == 2);
    CHECK(model_position(cloud, 0) == Vec3d(1.25, 2.25, 3.25));
    CHECK(model_position(cloud, 1) == Vec3d(4.5, 5.5, 6.5));
    CHECK(cloud.position_is_double);
    CHECK(cloud.exact_position.empty());  // float32 holds these numbers
    CHECK(cloud.color == std::vector<Rgba>{{10, 20, 30, 255}, {11, 22, 33, 255}});
    CHECK_FALSE(cloud.color_has_alpha);
    const std::vector<ScalarAttribute> expected{{"intensity", std::vector<std::int16_t>{-5, 7}},
                                                {"tiny", std::vector<std::int8_t>{-128, 127}},
                                                {"stamp", std::vector<std::uint32_t>{4000000000U, 1}},
                                                {"weight", std::vector<float>{0.5F, 0.25F}}};
    CHECK(cloud.scalars == expected);
    CHECK(read.report.from_mesh);
    CHECK(read.report.declared_count == 2);
    CHECK(read.report.skipped ==
          std::vector<std::string>{"element camera", "list neighbours", "element face"});
    CHECK(read.report.attributes ==
          std::vector<std::string>{"color", "intensity", "tiny", "stamp", "weight"});
  }
}

TEST_CASE("header lines may end in LF, CRLF or CR alone, and blanks do not matter") {
  const std::string lf =
      "ply\nformat  ascii\t1.0 \n\ncomment\t\tx\n element vertex\t2\nproperty float x\nproperty   float y \n"
      "property float z\nend_header\n1 2 3\n4 5 6\n";
  const Cloud expected = read_text(lf, CloudFormat::kPly).cloud;
  for (const char* end : {"\r\n", "\r"}) {
    std::string file;
    for (const char c : lf) file += c == '\n' ? std::string(end) : std::string(1, c);
    CHECK(difference(read_text(file, CloudFormat::kPly).cloud, expected).empty());
  }
}

TEST_CASE("after a header of CR lines the data starts at once, even if it starts like a line end") {
  for (const std::uint32_t first : {0x3f80000aU, 0x3f80000dU}) {  // floats whose first byte is LF or CR
    std::string file =
        "ply\rformat binary_little_endian 1.0\relement vertex 2\rproperty float x\rproperty float "
        "y\rproperty float "
        "z\rend_header\r";
    file += Row(false).put(first).put(2.0F).put(3.0F).put(4.0F).put(5.0F).put(6.0F).bytes();
    const Cloud cloud = in_caller_order(read_text(file, CloudFormat::kPly).cloud);
    CHECK(cloud.position.x()[0] == std::bit_cast<float>(first));
    CHECK(cloud.position.z()[1] == 6.0F);
  }
}

TEST_CASE("all spellings of the types are one") {
  constexpr const char* kOld[] = {"char", "uchar", "short", "ushort", "int", "uint", "float", "double"};
  constexpr const char* kNew[] = {"int8",  "uint8",  "int16",   "uint16",
                                  "int32", "uint32", "float32", "float64"};
  std::string header = "property float x\nproperty float y\nproperty float z\n";
  for (int i = 0; i < 8; ++i) {
    header += "property " + std::string(kOld[i]) + " old" + std::to_string(i) + "\n";
    header += "property " + std::string(kNew[i]) + " new" + std::to_string(i) + "\n";
  }
  std::string row = "1 2 3";
  for (int i = 0; i < 16; ++i) row += " 7";
  const Cloud cloud = read_text("ply\nformat ascii 1.0\nelement vertex 1\n" + header + "end_header\n" + row,
                                CloudFormat::kPly)
                          .cloud;
  REQUIRE(cloud.scalars.size() == 16);
  for (std::size_t i = 0; i < 8; ++i) {
    CHECK(cloud.scalars[2 * i].values.index() == i);
    CHECK(cloud.scalars[2 * i + 1].values.index() == i);
  }
}

std::string with_columns(const std::string& properties, const std::string& row) {
  return "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n" +
         properties + "end_header\n1 2 3 " + row + "\n";
}

TEST_CASE("texture coordinates go by three pairs of names") {
  for (const auto& [s, t] : {std::pair{"s", "t"}, std::pair{"u", "v"}, std::pair{"texture_u", "texture_v"}}) {
    const std::string file =
        with_columns("property float " + std::string(s) + "\nproperty float " + t + "\n", "0.25 0.75");
    const Cloud cloud = read_text(file, CloudFormat::kPly).cloud;
    CHECK(cloud.texcoord == std::vector<TexCoord>{{0.25F, 0.75F}});
    CHECK(cloud.scalars.empty());
  }
}

TEST_CASE("colours that are no bytes stay scalars of their own type") {
  const std::string properties = "property float red\nproperty float green\nproperty float blue\n";
  const Cloud cloud = read_text(with_columns(properties, "0.5 0.25 1"), CloudFormat::kPly).cloud;
  CHECK_FALSE(cloud.has_colors());
  REQUIRE(cloud.scalars.size() == 3);
  CHECK(cloud.scalars[1] == ScalarAttribute{"green", std::vector<float>{0.25F}});
  // Half a colour is none.
  const Cloud red = read_text(with_columns("property uchar red\n", "9"), CloudFormat::kPly).cloud;
  CHECK_FALSE(red.has_colors());
  CHECK(red.scalars.size() == 1);
}

TEST_CASE("normals are scaled to unit length, and kept as they are where one has no direction") {
  const std::string properties = "property float nx\nproperty float ny\nproperty float nz\n";
  const Cloud scaled = read_text(with_columns(properties, "0 3 4"), CloudFormat::kPly).cloud;
  CHECK(scaled.normal[0].isApprox(Vec3f(0, 0.6F, 0.8F)));
  for (const char* row : {"0 0 0", "nan 0 1", "inf 0 0"}) {
    const ImportedCloud none = read_text(with_columns(properties, row), CloudFormat::kPly);
    CHECK_FALSE(none.cloud.has_normals());
    CHECK(none.cloud.scalars.size() == 3);
    CHECK(none.report.skipped.size() == 1);
  }
}

TEST_CASE("integer coordinates are read; they count as double only where float32 would change them") {
  const auto file = [](const char* row) {
    return "ply\nformat ascii 1.0\nelement vertex 2\nproperty int x\nproperty int y\nproperty int "
           "z\nend_header\n" +
           std::string(row) + "\n1 2 3\n";
  };
  CHECK_FALSE(read_text(file("-409 249 4"), CloudFormat::kPly).cloud.position_is_double);
  const ImportedCloud large = read_text(file("16777217 0 0"), CloudFormat::kPly);
  CHECK(large.cloud.position_is_double);
  CHECK(large.report.bounds_max.x() == 16777217.0);
}

TEST_CASE("every attribute comes back from PLY to the bit, wherever the cloud stands") {
  for (const Place place : {Place::kNearZero, Place::kFarFloat, Place::kFarDouble, Place::kNearDouble}) {
    for (const bool ascii : {false, true}) {
      for (const bool caller_order : {false, true}) {
        const Cloud cloud = cloud_with_everything(300, place).cloud;
        Cloud again = through(cloud, CloudFormat::kPly, {.caller_order = caller_order, .ascii = ascii}).cloud;
        if (!caller_order) again.id = cloud.id;  // the order inside became the caller's
        CHECK(difference(cloud, again) == "");
      }
    }
  }
}

TEST_CASE("a sample that was moved keeps its place to the last bit") {
  Cloud cloud = cloud_with_everything(100, Place::kFarFloat).cloud;
  REQUIRE(cloud.exact_position.empty());
  cloud.position.set(3, Vec3f(0.1F, 0.2F, 0.3F));
  const Vec3d moved = model_position(cloud, 3);
  const std::uint32_t id = cloud.id[3];
  const ImportedCloud again = through(cloud, CloudFormat::kPly);
  CHECK(again.cloud.position_is_double);
  CHECK(model_position(in_caller_order(again.cloud), id) == moved);
}

TEST_CASE("a scalar whose name a standard property needs gets another one") {
  Cloud cloud =
      read_text(with_columns("property float nx\nproperty float ny\n", "5 6"), CloudFormat::kPly).cloud;
  cloud.normal.resize(1);
  cloud.normal.set(0, Vec3f(0, 0, 1));
  const Cloud again = through(cloud, CloudFormat::kPly).cloud;
  CHECK(again.normal == cloud.normal);
  CHECK(again.scalars[0] == ScalarAttribute{"scalar_nx", std::vector<float>{5.0F}});
}

TEST_CASE("negative zeros survive") {
  Cloud cloud =
      read_text(
          "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float "
          "z\nend_header\n-0 -0.0 1\n1 -1 0\n",
          CloudFormat::kPly)
          .cloud;
  for (const auto format : {CloudFormat::kPly, CloudFormat::kDraco, CloudFormat::kXyz}) {
    CHECK(difference(through(cloud, format).cloud, cloud) == "");
  }
  CHECK(std::signbit(in_caller_order(cloud).position.x()[0]));
}

}  // namespace
}  // namespace pointwright::io_test

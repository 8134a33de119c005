#include <doctest/doctest.h>

#include <cstring>
#include <map>

#include "engine/io/lzf.h"
#include "engine/io/pcd.h"
#include "tests/io/io_support.h"

namespace pointwright::io_test {
namespace {

template <typename... T>
std::string packed(T... values) {
  std::string bytes;
  const auto add = [&](auto v) { bytes.append(reinterpret_cast<const char*>(&v), sizeof v); };
  (add(values), ...);
  return bytes;
}

std::string pcd(const std::string& fields, const std::string& size, const std::string& type,
                const std::string& points, const std::string& data, const std::string& body,
                const std::string& count = "") {
  return "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS " + fields + "\nSIZE " + size +
         "\nTYPE " + type + "\n" + (count.empty() ? "" : "COUNT " + count + "\n") + "WIDTH " + points +
         "\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS " + points + "\nDATA " + data + "\n" + body;
}
std::string xyz(const std::string& points, const std::string& data, const std::string& body) {
  return pcd("x y z", "4 4 4", "F F F", points, data, body);
}

ErrorCode code_of(const std::string& text, const ImportParams& params = {}) {
  return error_of(text, CloudFormat::kPcd, params).code;
}

// A plain compressor: repeats of one byte at distance 1, the rest literal.
std::string lzf(const std::string& data) {
  std::string out;
  for (std::size_t i = 0; i < data.size();) {
    std::size_t run = 0;
    while (i > 0 && i + run < data.size() && data[i + run] == data[i - 1] && run < 264) ++run;
    if (run >= 3 && run <= 8) {
      out += static_cast<char>((run - 2) << 5U);
      out += '\0';
      i += run;
    } else if (run > 8) {
      out += static_cast<char>(7U << 5U);
      out += static_cast<char>(run - 9);
      out += '\0';
      i += run;
    } else {
      out += '\0';
      out += data[i++];
    }
  }
  return out;
}

std::string compressed(const std::string& columns) {
  const std::string small = lzf(columns);
  return packed(static_cast<std::uint32_t>(small.size()), static_cast<std::uint32_t>(columns.size())) + small;
}

TEST_CASE("PCD: the three encodings give the same cloud") {
  const std::string rows = packed(1.0F, 2.0F, 3.0F, 4.5F, 5.0F, -6.0F, 0.0F, 0.0F, 0.0F);
  const std::string columns = packed(1.0F, 4.5F, 0.0F, 2.0F, 5.0F, 0.0F, 3.0F, -6.0F, 0.0F);
  const Cloud ascii = read_text(xyz("3", "ascii", "1 2 3\n4.5 5 -6\n0 0 0\n"), CloudFormat::kPcd).cloud;
  const Cloud binary = read_text(xyz("3", "binary", rows), CloudFormat::kPcd).cloud;
  const Cloud small = read_text(xyz("3", "binary_compressed", compressed(columns)), CloudFormat::kPcd).cloud;
  CHECK(difference(binary, ascii) == "");
  CHECK(difference(small, ascii) == "");
  CHECK(model_position(in_caller_order(ascii), 1) == Vec3d(4.5, 5, -6));
  const Cloud carriage =
      read_text(xyz("3", "ascii", "1 2 3\r\n4.5 5 -6\r\n\r\n0 0 0"), CloudFormat::kPcd).cloud;
  CHECK(difference(carriage, ascii) == "");
}

TEST_CASE("PCD: every type, fields in any order, padding and arrays") {
  const std::string row =
      packed(std::int8_t{-5}, std::uint8_t{200}, std::int16_t{-300}, std::uint16_t{60000}) +
      std::string(3, '\x7f') +
      packed(500000.123, 4649776.456, 12.5, std::int32_t{-70000}, std::uint32_t{4000000000U}, 0.5F, 0.25F,
             std::int64_t{-9}, std::uint64_t{1} << 40U);
  const std::string file = pcd("a b c d _ x y z e f pair g h", "1 1 2 2 1 8 8 8 4 4 4 8 8",
                               "I U I U U F F F I U F I U", "1", "binary", row, "1 1 1 1 3 1 1 1 1 1 2 1 1");
  const Cloud cloud = read_text(file, CloudFormat::kPcd).cloud;
  CHECK(cloud.position_is_double);
  CHECK(model_position(cloud, 0) == Vec3d(500000.123, 4649776.456, 12.5));
  const std::vector<ScalarAttribute> expected{
      {"a", std::vector<std::int8_t>{-5}},      {"b", std::vector<std::uint8_t>{200}},
      {"c", std::vector<std::int16_t>{-300}},   {"d", std::vector<std::uint16_t>{60000}},
      {"e", std::vector<std::int32_t>{-70000}}, {"f", std::vector<std::uint32_t>{4000000000U}},
      {"pair_0", std::vector<float>{0.5F}},     {"pair_1", std::vector<float>{0.25F}},
      {"g", std::vector<double>{-9.0}},         {"h", std::vector<double>{1099511627776.0}}};
  CHECK(cloud.scalars == expected);
  const std::string text = pcd(
      "a b c d _ x y z e f pair g h", "1 1 2 2 1 8 8 8 4 4 4 8 8", "I U I U U F F F I U F I U", "1", "ascii",
      "-5 200 -300 60000 1 2 3 500000.123 4649776.456 12.5 -70000 4000000000 0.5 0.25 -9 "
      "1099511627776\n",
      "1 1 1 1 3 1 1 1 1 1 2 1 1");
  CHECK(difference(read_text(text, CloudFormat::kPcd).cloud, cloud) == "");
}

TEST_CASE("PCD: packed colours and normals are recognised") {
  for (const char* type : {"F", "U", "I"}) {
    CAPTURE(type);
    const std::string file = pcd("x y z rgb normal_x normal_y normal_z curvature", "4 4 4 4 4 4 4 4",
                                 std::string("F F F ") + type + " F F F F", "1", "binary",
                                 packed(1.0F, 2.0F, 3.0F, std::uint32_t{0x00102030}, 0.0F, 0.0F, 1.0F, 0.5F));
    const Cloud cloud = read_text(file, CloudFormat::kPcd).cloud;
    REQUIRE(cloud.has_colors());
    CHECK(cloud.color[0] == Rgba{0x10, 0x20, 0x30, 255});
    CHECK_FALSE(cloud.color_has_alpha);
    CHECK(cloud.has_normals());
    REQUIRE(cloud.scalars.size() == 1);
    CHECK(cloud.scalars[0].name == "curvature");
  }
  const Cloud with_alpha =
      read_text(pcd("x y z rgba", "4 4 4 4", "F F F U", "1", "ascii", "1 2 3 2148532224\n"),
                CloudFormat::kPcd)
          .cloud;
  CHECK(with_alpha.color_has_alpha);
  CHECK(with_alpha.color[0] == Rgba{0x10, 0x00, 0x00, 0x80});
}

TEST_CASE("PCD: an organised cloud says so, and its holes are the caller's to decide") {
  std::string file = xyz("4", "ascii", "1 2 3\nnan nan nan\n4 5 6\n7 8 9\n");
  file.replace(file.find("WIDTH 4\nHEIGHT 1"), 16, "WIDTH 2\nHEIGHT 2");
  CHECK(code_of(file) == ErrorCode::kNonFinite);
  const ImportedCloud dropped = read_text(file, CloudFormat::kPcd, {.drop_non_finite = true});
  CHECK(dropped.report.encoding == "ascii, organised 2 x 2");
  CHECK(dropped.report.dropped_non_finite == 1);
  CHECK(dropped.cloud.size() == 3);
  const std::string holes = pcd("x y z normal_x normal_y normal_z", "4 4 4 4 4 4", "F F F F F F", "2",
                                "ascii", "nan nan nan nan nan nan\n1 2 3 0 0 1\n");
  CHECK(read_text(holes, CloudFormat::kPcd, {.drop_non_finite = true}).cloud.has_normals());
}

TEST_CASE("PCD: what the header claims is held against the bytes") {
  CHECK(code_of(xyz("2", "ascii", "1 2 3\n")) == ErrorCode::kMalformedData);
  CHECK(code_of(xyz("1", "ascii", "1 2 3\n4 5 6\n")) == ErrorCode::kMalformedData);
  CHECK(code_of(xyz("1", "ascii", "1 2\n")) == ErrorCode::kMalformedData);
  CHECK(code_of(xyz("1", "ascii", "1 2 3 4\n")) == ErrorCode::kMalformedData);
  CHECK(code_of(xyz("2", "binary", packed(1.0F, 2.0F, 3.0F))) == ErrorCode::kMalformedData);
  CHECK(code_of(xyz("1000000", "binary_compressed", compressed("abc"))) == ErrorCode::kMalformedData);
  CHECK(code_of(xyz("3", "ascii", "1 2 3\n1 2 3\n1 2 3\n"), {.max_samples = 2}) == ErrorCode::kTooLarge);
  CHECK(code_of(xyz("0", "ascii", "")) == ErrorCode::kEmptyCloud);
  CHECK(code_of(pcd("x y", "4 4", "F F", "1", "ascii", "1 2\n")) == ErrorCode::kMalformedData);
  CHECK(code_of(pcd("x y z", "4 4", "F F F", "1", "ascii", "1 2 3\n")) == ErrorCode::kMalformedData);
  CHECK(code_of(pcd("x y z", "4 4 3", "F F F", "1", "ascii", "1 2 3\n")) == ErrorCode::kMalformedData);
  CHECK(code_of(pcd("x y z", "4 4 1", "F F F", "1", "ascii", "1 2 3\n")) == ErrorCode::kMalformedData);
  CHECK(code_of(pcd("x y z w", "4 4 4 4", "F F F F", "1", "ascii", "1 2 3 4\n", "1 1 1 4000000000")) ==
        ErrorCode::kMalformedData);
  CHECK(code_of(xyz("1", "zipped", "1 2 3\n")) == ErrorCode::kUnsupportedFormat);
  std::string old = xyz("1", "ascii", "1 2 3\n");
  old.replace(old.find("VERSION 0.7"), 11, "VERSION 9.9");
  CHECK(code_of(old) == ErrorCode::kUnsupportedFormat);
  std::string wide = xyz("1", "ascii", "1 2 3\n");
  wide.replace(wide.find("WIDTH 1\nHEIGHT 1"), 16, "WIDTH 9223372036854775807\nHEIGHT 9");
  CHECK(code_of(wide) == ErrorCode::kMalformedData);
  const std::string whole = xyz("4", "binary_compressed", compressed(std::string(48, '\x02')));
  REQUIRE(read_text(whole, CloudFormat::kPcd).cloud.size() == 4);
  for (std::size_t length = 1; length < whole.size(); ++length)
    CHECK_FALSE(read_cloud(bytes_of(whole.substr(0, length)), CloudFormat::kPcd, {}).ok());
}

TEST_CASE("LZF: what is not its own length, or points outside itself, is refused") {
  const auto expand = [](std::string_view data, std::size_t length) {
    std::vector<std::byte> out(length);
    const auto done = expand_lzf(bytes_of(data), out);
    return done.ok() ? text_of(out) : "refused";
  };
  CHECK(expand(std::string_view("\x02"
                                "abc",
                                4),
               3) == "abc");
  CHECK(expand(std::string_view("\x00"
                                "a\x20\x00",
                                4),
               4) == "aaaa");
  CHECK(expand(std::string_view("\x01"
                                "ab\xE0\x01\x01",
                                6),
               12) == "abababababab");
  CHECK(expand("", 0).empty());
  CHECK(expand(std::string_view("\x02"
                                "abc",
                                4),
               2) == "refused");
  CHECK(expand(std::string_view("\x02"
                                "abc",
                                4),
               4) == "refused");
  CHECK(expand(std::string_view("\x03"
                                "abc",
                                4),
               4) == "refused");
  CHECK(expand(std::string_view("\x00"
                                "a\x20\x01",
                                4),
               4) == "refused");
  CHECK(expand(std::string_view("\x00"
                                "a\x20",
                                3),
               4) == "refused");
  CHECK(expand(std::string_view("\x00"
                                "a\xE0\x09",
                                4),
               20) == "refused");
  CHECK(expand(std::string_view("\x20\x00", 2), 3) == "refused");
  Random random(5);
  for (int i = 0; i < 2000; ++i) {
    std::string noise(random.below(40), '\0');
    for (char& c : noise) c = static_cast<char>(random.next());
    const std::string result = expand(noise, random.below(200));
    CHECK((result == "refused" || result.size() < 200));
  }
}

}  // namespace
}  // namespace pointwright::io_test

#include <doctest/doctest.h>

#include <cstring>

#include "tests/io/io_support.h"

namespace pointwright::io_test {
namespace {

const char* const kXyz = "property float x\nproperty float y\nproperty float z\n";

std::string ascii(const std::string& elements, const std::string& body) {
  return "ply\nformat ascii 1.0\n" + elements + "end_header\n" + body;
}

ErrorCode code_of(const std::string& file) {
  return error_of(file, CloudFormat::kPly).code;
}

TEST_CASE("headers that are not what a PLY header is are refused with their line") {
  const std::string vertex = std::string("element vertex 1\n") + kXyz;
  for (const std::string& file :
       {std::string("ply"), std::string("ply\n"), std::string("ply\nformat ascii 1.0\n"),
        "ply\n" + vertex + "end_header\n1 2 3\n", ascii("element vertex -1\n" + std::string(kXyz), ""),
        ascii("element vertex 1e3\n" + std::string(kXyz), ""),
        ascii("element vertex 99999999999999999999\n" + std::string(kXyz), ""), ascii("element vertex\n", ""),
        ascii("property float x\n", ""), ascii(vertex + "property\n", ""),
        ascii(vertex + "property quad q\n", ""), ascii(vertex + "property float\n", ""),
        ascii(vertex + "property list float int l\n", ""), ascii(vertex + "property list uchar\n", ""),
        ascii(vertex + "whatever\n", "1 2 3\n"),
        ascii("element vertex 1\nproperty float x\nproperty float y\n", "1 2\n"),
        ascii(vertex + "property float x\n", "1 2 3 4\n"), std::string("ply\0\n", 5)}) {
    CHECK(code_of(file) == ErrorCode::kMalformedData);
  }
  CHECK(code_of("ply\nformat ascii 2.0\n") == ErrorCode::kUnsupportedFormat);
  CHECK(code_of("ply\nformat binary 1.0\n") == ErrorCode::kUnsupportedFormat);
  CHECK(error_of(ascii(vertex + "property quad q\n", ""), CloudFormat::kPly).message.find("line 7") !=
        std::string::npos);
}

TEST_CASE("a file without vertices is empty, not broken") {
  CHECK(code_of(ascii("", "")) == ErrorCode::kEmptyCloud);
  CHECK(code_of(ascii("element face 1\nproperty list uchar int i\n", "1 0\n")) == ErrorCode::kEmptyCloud);
  CHECK(code_of(ascii(std::string("element vertex 0\n") + kXyz, "")) == ErrorCode::kEmptyCloud);
}

TEST_CASE("rows that do not fit their header are refused with their line") {
  const std::string two = std::string("element vertex 2\n") + kXyz;
  for (const char* body : {"", "1 2 3\n", "1 2 3\n4 5\n", "1 2 3\n4 5 6 7\n", "1 2 3\n4 5 x\n",
                           "1 2 3\n4 5 6\n7 8 9\n", "1 2 3 4 5 6\n", "1 2 3\n4 5 6\n\n\nx"}) {
    CAPTURE(body);
    CHECK(code_of(ascii(two, body)) == ErrorCode::kMalformedData);
  }
  const std::string with_byte = std::string("element vertex 1\n") + kXyz + "property uchar red\n";
  for (const char* body : {"1 2 3 256", "1 2 3 -1", "1 2 3 1.5", "1 2 3 red"}) {
    CHECK(code_of(ascii(with_byte, body)) == ErrorCode::kMalformedData);
  }
  CHECK(error_of(ascii(two, "1 2 3\n4 5 x\n"), CloudFormat::kPly).message.find("line 9") !=
        std::string::npos);
  const std::string list = std::string("element vertex 1\n") + kXyz + "property list uchar int l\n";
  for (const char* body : {"1 2 3", "1 2 3 2 5", "1 2 3 -1", "1 2 3 99999999999999999999"}) {
    CHECK(code_of(ascii(list, body)) == ErrorCode::kMalformedData);
  }
}

TEST_CASE("a count that the bytes cannot hold is refused before anything is allocated") {
  const std::uint64_t before = peak_memory();
  for (const char* format : {"ascii", "binary_little_endian", "binary_big_endian"}) {
    const auto claim = [&](const std::string& elements) {
      return "ply\nformat " + std::string(format) + " 1.0\n" + elements + "end_header\n1 2 3\n";
    };
    CHECK(code_of(claim(std::string("element vertex 1000000000\n") + kXyz)) == ErrorCode::kTooLarge);
    CHECK(code_of(claim(std::string("element vertex 49000000\n") + kXyz)) == ErrorCode::kMalformedData);
    CHECK(code_of(claim("element vertex 49000000\nproperty list uchar int l\n")) ==
          ErrorCode::kMalformedData);
    CHECK(code_of(claim("element face 18446744073709551615\nproperty list uchar int l\nelement vertex 1\n" +
                        std::string(kXyz))) == ErrorCode::kMalformedData);
    CHECK(code_of(claim(
              "element a 18446744073709551615\nproperty double d\nproperty double e\nelement vertex 1\n" +
              std::string(kXyz))) == ErrorCode::kMalformedData);
    CHECK(code_of(claim("element vertex 49000000\n")) == ErrorCode::kMalformedData);  // no property at all
  }
  const Error limited = error_of(ascii(std::string("element vertex 3\n") + kXyz, "1 2 3\n4 5 6\n7 8 9\n"),
                                 CloudFormat::kPly, {.max_samples = 2});
  CHECK(limited.code == ErrorCode::kTooLarge);
  CHECK(limited.limit == 2.0);
  CHECK(limited.actual == 3.0);
  CHECK(peak_memory() - before < (64U << 20));
}

TEST_CASE("a file cut at any byte is refused, unless only the last number of a text lost digits") {
  const Cloud cloud = cloud_with_everything(5, Place::kFarDouble).cloud;
  for (const bool is_ascii : {false, true}) {
    const auto whole = write_cloud(cloud, CloudFormat::kPly, {.ascii = is_ascii}).value();
    for (std::size_t length = 0; length < whole.size(); ++length) {
      const auto cut = read_cloud(std::span(whole).first(length), CloudFormat::kPly, {});
      if (!cut.ok()) continue;
      CHECK(is_ascii);
      CHECK(text_of(whole).find('\n', length) == whole.size() - 1);
      CHECK(cut.value().cloud.size() == cloud.size());
    }
  }
}

TEST_CASE("bytes after the last element are refused, but for line ends and zeros") {
  auto whole = write_cloud(sphere(10).cloud, CloudFormat::kPly, {}).value();
  whole.push_back(std::byte{'\n'});
  CHECK(read_cloud(whole, CloudFormat::kPly, {}).ok());
  whole.push_back(std::byte{'x'});
  CHECK(error_of(whole, CloudFormat::kPly).code == ErrorCode::kMalformedData);
}

TEST_CASE("flipped bytes never bring down the reader, and what it takes is sound") {
  Random random(7);
  for (const bool is_ascii : {false, true}) {
    const auto whole =
        write_cloud(cloud_with_everything(6, Place::kNearZero).cloud, CloudFormat::kPly, {.ascii = is_ascii})
            .value();
    for (int round = 0; round < 3000; ++round) {
      auto mutant = whole;
      for (std::uint64_t flips = 1 + random.below(4); flips > 0; --flips) {
        mutant[random.below(mutant.size())] = static_cast<std::byte>(random.next());
      }
      const auto read = read_cloud(mutant, CloudFormat::kPly, {});
      if (read.ok()) CHECK(validate(read.value().cloud).ok());
    }
  }
}

}  // namespace
}  // namespace pointwright::io_test

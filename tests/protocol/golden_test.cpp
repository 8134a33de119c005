#include "tests/protocol/golden.h"

#include <doctest/doctest.h>

#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>

using namespace pointwright::protocol;

namespace {

std::string read_file(const std::string& path) {
  std::ifstream in(std::string(POINTWRIGHT_SOURCE_DIR) + "/protocol/" + path, std::ios::binary);
  REQUIRE_MESSAGE(in, path);
  return {std::istreambuf_iterator<char>(in), {}};
}

}  // namespace

TEST_CASE("the code writes the very bytes of the golden frames") {
  // A difference here is a change of the wire format, or of the encoder's rounding: never rewrite the files
  // for it unless that is what you meant (pointwright_write_golden).
  for (const golden::File& file : golden::vector_files()) {
    CAPTURE(file.path);
    CHECK((read_file(file.path) == file.content));
  }
}

TEST_CASE("the documents that the server sends are those of the examples") {
  for (const golden::File& file : golden::document_files()) {
    CAPTURE(file.path);
    CHECK(read_file(file.path) == file.content);
  }
}

TEST_CASE("every malformed golden frame is refused") {
  const auto list = nlohmann::json::parse(read_file("vectors/malformed.json"));
  CHECK(list.size() > 30);
  for (const auto& entry : list) {
    const auto name = entry.at("name").get<std::string>();
    CAPTURE(name);
    std::string bytes = read_file("vectors/" + entry.at("file").get<std::string>());
    if (entry.contains("cut")) bytes.resize(entry["cut"].get<std::size_t>());
    if (entry.contains("append")) bytes.append(entry["append"].get<std::size_t>(), '\0');
    if (entry.contains("offset")) {
      std::size_t at = entry["offset"].get<std::size_t>();
      for (const auto& value : entry["bytes"]) bytes.at(at++) = static_cast<char>(value.get<unsigned char>());
    }
    CHECK_FALSE(decode_frame(std::as_bytes(std::span(bytes))).ok());
  }
}

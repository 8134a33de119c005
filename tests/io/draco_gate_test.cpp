#include "engine/io/draco_gate.h"

#include <doctest/doctest.h>

#include <string>

#include "tests/io/io_support.h"

namespace pointwright::io_test {
namespace {

constexpr std::uint64_t kQuota = 50'000'000;

// A header written by hand.
class Header {
 public:
  Header(int major, int minor, int kind, int method, int flags = 0) {
    text_ = "DRACO";
    for (const int value : {major, minor, kind, method, flags & 0xff, flags >> 8}) byte(value);
  }
  Header& byte(int value) {
    text_ += static_cast<char>(value);
    return *this;
  }
  Header& word(std::uint32_t value) {
    for (int i = 0; i < 4; ++i) byte(static_cast<int>((value >> (8 * i)) & 0xff));
    return *this;
  }
  Header& varint(std::uint32_t value) {
    for (; value >= 0x80; value >>= 7) byte(static_cast<int>(value & 0x7f) | 0x80);
    return byte(static_cast<int>(value));
  }
  Header& position() { return byte(0).byte(9).byte(3).byte(0).byte(0); }
  Header& padding(std::size_t size) {
    text_.append(size, '\0');
    return *this;
  }
  [[nodiscard]] Result<DracoClaim> gate(std::uint64_t quota = kQuota) const {
    return draco_gate(bytes_of(text_), quota);
  }
  [[nodiscard]] std::size_t size() const { return text_.size(); }

 private:
  std::string text_;
};

Header cloud(std::uint32_t points) {
  return Header(2, 3, 0, 0).word(points);
}

TEST_CASE("the gate reads what a current file claims") {
  const auto claim = cloud(1000).byte(1).varint(1).position().padding(50).gate();
  REQUIRE(claim.ok());
  CHECK(claim.value().points == 1000);
  CHECK(claim.value().sample_bytes == 12);
  CHECK(claim.value().encoding == "sequential");
  const auto mesh = Header(2, 2, 1, 1).byte(0).varint(300).varint(500).padding(50).gate();
  REQUIRE(mesh.ok());
  CHECK(mesh.value().is_mesh);
  CHECK(mesh.value().points == 300);
  CHECK(mesh.value().faces == 500);
  CHECK(mesh.value().encoding == "mesh_edgebreaker");
  const auto sequential = Header(2, 2, 1, 0).varint(500).varint(300).padding(50).gate();
  CHECK(sequential.value().points == 300);
  CHECK(sequential.value().faces == 500);
}

TEST_CASE("the gate passes what the writer writes") {
  for (const Place place : {Place::kNearZero, Place::kFarFloat, Place::kFarDouble}) {
    const Cloud made = cloud_with_everything(500, place).cloud;
    for (const int bits : {0, 14}) {
      const auto claim =
          draco_gate(write_cloud(made, CloudFormat::kDraco, {.draco_position_bits = bits}).value(), kQuota);
      REQUIRE(claim.ok());
      CHECK(claim.value().points == 500);
    }
  }
}

TEST_CASE("old bitstreams are refused by name") {
  for (const auto& [major, minor, kind] :
       {std::array{1, 1, 0}, {1, 2, 1}, {2, 0, 1}, {2, 1, 1}, {2, 1, 0}, {2, 3, 1}, {3, 0, 0}}) {
    const auto refused = Header(major, minor, kind, 0).padding(100).gate();
    REQUIRE_FALSE(refused.ok());
    CHECK(refused.error().code == ErrorCode::kUnsupportedFormat);
  }
  CHECK(Header(2, 3, 0, 0, 0x4000).padding(99).gate().error().code == ErrorCode::kUnsupportedFormat);
  CHECK(Header(2, 3, 2, 0).padding(99).gate().error().code == ErrorCode::kMalformedData);
  CHECK(Header(2, 3, 0, 2).padding(99).gate().error().code == ErrorCode::kMalformedData);
}

TEST_CASE("claims out of proportion to the bytes are refused") {
  const auto rest = [](Header header) { return header.byte(1).varint(1).position().padding(30); };
  CHECK(rest(cloud(100'000'000)).gate().error().code == ErrorCode::kTooLarge);  // beyond the quota
  CHECK(rest(cloud(1'000'000)).gate().error().code == ErrorCode::kTooLarge);    // a million in 58 bytes
  CHECK(rest(cloud(20'000)).gate().ok());
  CHECK(rest(cloud(0)).gate().error().code == ErrorCode::kEmptyCloud);
  CHECK(rest(cloud(0xffffffffU)).gate().error().code == ErrorCode::kMalformedData);
  CHECK(rest(cloud(20'000)).gate(19'999).error().actual == 20'000.0);
  CHECK(Header(2, 2, 1, 1).byte(0).varint(3).varint(0xffffffffU).padding(50).gate().error().code ==
        ErrorCode::kTooLarge);
  CHECK(Header(2, 2, 1, 0).varint(0xffffffffU).varint(3).padding(50).gate().error().code ==
        ErrorCode::kTooLarge);
}

TEST_CASE("attributes out of all proportion are refused") {
  const auto code = [](const Header& header) { return header.gate().error().code; };
  CHECK(code(cloud(10).byte(0).padding(50)) == ErrorCode::kMalformedData);            // no group
  CHECK(code(cloud(10).byte(2).padding(50)) == ErrorCode::kMalformedData);            // two groups
  CHECK(code(cloud(10).byte(1).varint(0).padding(50)) == ErrorCode::kMalformedData);  // no attribute
  CHECK(code(cloud(10).byte(1).varint(65).padding(400)) == ErrorCode::kMalformedData);
  CHECK(code(cloud(10).byte(1).varint(1).byte(0).byte(9).byte(255).byte(0).byte(0)) ==
        ErrorCode::kMalformedData);
  CHECK(code(cloud(10).byte(1).varint(1).byte(0).byte(9).byte(0).byte(0).byte(0)) ==
        ErrorCode::kMalformedData);
  CHECK(code(cloud(10).byte(1).varint(1).byte(0).byte(12).byte(3).byte(0).byte(0)) ==
        ErrorCode::kMalformedData);
  CHECK(code(cloud(10).byte(1).varint(1).byte(5).byte(9).byte(3).byte(0).byte(0)) ==
        ErrorCode::kMalformedData);
  Header wide = cloud(300'000).byte(1).varint(60);
  for (int i = 0; i < 60; ++i) wide.byte(4).byte(10).byte(16).byte(0).byte(i);
  CHECK(code(wide) == ErrorCode::kTooLarge);
}

TEST_CASE("metadata is walked over, and bombs of it are refused") {
  Header good(2, 3, 0, 0, 0x8000);
  good.varint(1).varint(7).varint(1).byte(4);
  for (const char c : std::string("name")) good.byte(c);
  good.varint(2).byte('a').byte('b').varint(0);                    // the attribute's entry, no children
  good.varint(0).varint(1).byte(1).byte('k').varint(0).varint(0);  // the cloud's: one child
  CHECK(good.word(20).byte(1).varint(1).position().padding(30).gate().ok());
  Header deep(2, 3, 0, 0, 0x8000);
  deep.varint(0);
  for (int i = 0; i < 100; ++i) deep.varint(0).varint(1).byte(0);
  CHECK(deep.gate().error().code == ErrorCode::kMalformedData);
  Header wide(2, 3, 0, 0, 0x8000);
  wide.varint(0).varint(0).varint(100'000);
  CHECK(wide.padding(400'000).gate().error().code == ErrorCode::kMalformedData);
  Header long_entry(2, 3, 0, 0, 0x8000);
  CHECK(long_entry.varint(0).varint(1).byte(0).varint(0xffffffffU).padding(20).gate().error().code ==
        ErrorCode::kMalformedData);
}

TEST_CASE("a header cut anywhere is refused") {
  const auto whole =
      write_cloud(cloud_with_everything(9, Place::kFarFloat).cloud, CloudFormat::kDraco, {}).value();
  std::size_t passed = 0;
  for (std::size_t length = 0; length < whole.size(); ++length) {
    if (draco_gate(std::span(whole).first(length), kQuota).ok()) ++passed;
  }
  CHECK(passed < whole.size() - 200);  // what is left to the decoder is the coded values
}

}  // namespace
}  // namespace pointwright::io_test

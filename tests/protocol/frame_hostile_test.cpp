// The decoder against bytes from strangers. Run under AddressSanitizer this also shows that it is
// memory-safe: every input lies in a heap buffer of exactly its length.
#include <doctest/doctest.h>

#include <algorithm>
#include <random>

#include "protocol/frames/frame.h"
#include "protocol/frames/stream_record.h"
#include "tests/protocol/golden.h"

using namespace pointwright;
using namespace pointwright::protocol;

namespace {

std::vector<std::byte> bytes_of(const std::string& text) {
  const auto bytes = std::as_bytes(std::span(text));
  return {bytes.begin(), bytes.end()};
}

std::vector<std::byte> golden_file(const std::string& path) {
  for (const golden::File& file : golden::vector_files()) {
    if (file.path == path) return bytes_of(file.content);
  }
  FAIL("no golden file " << path);
  return {};
}

/// Reads everything that a decoder hands out, so that a bad length cannot hide.
void use(const DecodedFrame& frame) {
  std::size_t samples = 0;
  for (const DecodedBlock& block : frame.blocks) {
    REQUIRE(block.number < frame.header.block_count);
    REQUIRE(decode_positions(frame.header, block).size() == block.count);
    REQUIRE(decode_normals(block).size() == block.normal.size());
    samples += block.count;
  }
  REQUIRE(samples <= frame.header.sample_count);
}

}  // namespace

TEST_CASE("every truncation of a frame is refused") {
  for (const char* path :
       {"vectors/key.frame", "vectors/delta.frame", "vectors/single.frame", "vectors/empty.frame"}) {
    const std::vector<std::byte> whole = golden_file(path);
    REQUIRE(decode_frame(whole).ok());
    for (std::size_t length = 0; length < whole.size(); ++length) {
      const std::vector<std::byte> cut(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(length));
      REQUIRE_FALSE(decode_frame(cut).ok());
      // A cut that also corrects the announced length must not get through either.
      if (length < kFrameHeaderBytes) continue;
      std::vector<std::byte> corrected = cut;
      store(corrected.data() + 8, static_cast<std::uint32_t>(length));
      REQUIRE_FALSE(decode_frame(corrected).ok());
    }
  }
}

TEST_CASE("extra bytes are refused") {
  for (const char* path : {"vectors/key.frame", "vectors/empty.frame"}) {
    std::vector<std::byte> longer = golden_file(path);
    for (int extra = 0; extra < 40; ++extra) {
      longer.push_back(std::byte{0});
      REQUIRE_FALSE(decode_frame(longer).ok());
      store(longer.data() + 8, static_cast<std::uint32_t>(longer.size()));
      REQUIRE_FALSE(decode_frame(longer).ok());
    }
  }
}

TEST_CASE("mutants are refused or decode to something sound") {
  std::mt19937 random(20260131);
  for (const char* path : {"vectors/key.frame", "vectors/delta.frame"}) {
    const std::vector<std::byte> whole = golden_file(path);
    int accepted = 0;
    for (int round = 0; round < 20'000; ++round) {
      std::vector<std::byte> mutant = whole;
      const int changes = 1 + static_cast<int>(random() % 4);
      for (int change = 0; change < changes; ++change) {
        // Mostly in the headers: that is where a decoder decides.
        const std::size_t span =
            random() % 4 == 0 ? mutant.size() : std::min<std::size_t>(mutant.size(), 128);
        const std::size_t at = random() % span;
        constexpr std::array<unsigned, 6> kTelling{0x00, 0x01, 0x7F, 0x80, 0xFE, 0xFF};
        mutant[at] =
            static_cast<std::byte>(random() % 2 == 0 ? random() % 256 : kTelling[random() % kTelling.size()]);
      }
      const auto frame = decode_frame(mutant);
      if (frame.ok()) {
        ++accepted;
        use(frame.value());
      }
    }
    CHECK(accepted > 0);  // changed samples and colours are still frames
  }
}

TEST_CASE("random bytes are no frame") {
  std::mt19937 random(3);
  for (int round = 0; round < 2000; ++round) {
    std::vector<std::byte> bytes(random() % 400);
    for (std::byte& byte : bytes) byte = static_cast<std::byte>(random() % 256);
    REQUIRE_FALSE(decode_frame(bytes).ok());
  }
}

TEST_CASE("refusals say what kind they are") {
  std::vector<std::byte> bytes = golden_file("vectors/key.frame");
  store(bytes.data() + 4, std::uint16_t{2});
  CHECK(decode_frame(bytes).error().code == ErrorCode::kUnsupportedFormat);
  bytes = golden_file("vectors/key.frame");
  const auto limited = decode_frame(bytes, {.max_samples = 149});
  REQUIRE_FALSE(limited.ok());
  CHECK(limited.error().code == ErrorCode::kTooLarge);
  CHECK(limited.error().limit == 149);
  CHECK(limited.error().actual == 150);
  CHECK(decode_frame({}).error().code == ErrorCode::kMalformedData);
}

TEST_CASE("stream records come whole out of chunks that are cut anywhere") {
  const std::vector<std::byte> stream = golden_file("vectors/stream.bin");
  for (const std::size_t chunk :
       {std::size_t{1}, std::size_t{3}, std::size_t{8}, std::size_t{1000}, stream.size()}) {
    StreamRecordParser parser;
    std::vector<StreamRecord> records;
    for (std::size_t at = 0; at < stream.size(); at += chunk) {
      parser.push(std::span(stream).subspan(at, std::min(chunk, stream.size() - at)));
      for (;;) {
        auto record = parser.next();
        REQUIRE(record.ok());
        if (!record.value()) break;
        records.push_back(*std::move(record).value());
      }
    }
    CHECK(parser.at_record_end());
    REQUIRE(records.size() == 5);
    CHECK(records[1].type == 1);
    CHECK(decode_frame(records[1].payload).ok());
    CHECK(records[2].type == 77);
    CHECK(records[3].payload.empty());
  }
}

TEST_CASE("a stream that is cut or announces too much is noticed") {
  const std::vector<std::byte> stream = golden_file("vectors/stream.bin");
  StreamRecordParser parser;
  parser.push(std::span(stream).first(12));
  CHECK_FALSE(parser.next().value().has_value());
  CHECK_FALSE(parser.at_record_end());
  StreamRecordParser small(16);
  small.push(stream);
  for (int i = 0; i < 2; ++i) {
    const auto record = small.next();
    REQUIRE_FALSE(record.ok());
    CHECK(record.error().code == ErrorCode::kTooLarge);
  }
  CHECK_THROWS_AS((void)stream_record_header(StreamRecordType::kFrame, std::size_t{1} << 32), LogicError);
}

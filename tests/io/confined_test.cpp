#include "server/ingest/confined.h"

#include <doctest/doctest.h>

#include <cstring>
#include <filesystem>
#include <limits>
#include <string>
#include <thread>

#include "engine/io/decoded_cloud.h"
#include "server/ingest/sandbox.h"
#include "tests/io/io_support.h"

namespace pointwright::io_test {
namespace {

ConfineLimits limits() {
  ConfineLimits result;
  result.program = POINTWRIGHT_TEST_DECODER;
  return result;
}

Result<ImportedCloud> read(std::span<const std::byte> bytes, CloudFormat format,
                           const ImportParams& params = {}, const ConfineLimits& within = limits()) {
  auto decoded = decode_confined(bytes, format, params, within);
  if (!decoded.ok()) return decoded;
  return finish_cloud(std::move(decoded).value(), params);
}

std::size_t open_descriptors() {
  std::size_t count = 0;
  for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator("/proc/self/fd")) ++count;
  return count;
}

// Where the count of points stands in a Draco cloud without metadata: after the eleven bytes of the header.
std::vector<std::byte> with_point_count(std::vector<std::byte> file, std::uint32_t count) {
  std::memcpy(file.data() + 11, &count, sizeof(count));
  return file;
}

// All samples on one place: the smallest file for its count. At zero, so that there is no origin to note.
std::vector<std::byte> tiny_draco(std::size_t count) {
  std::string text;
  for (std::size_t i = 0; i < count; ++i) text += "0 0 0\n";
  const Cloud cloud = read_text(text, CloudFormat::kXyz).cloud;
  return write_cloud(cloud, CloudFormat::kDraco, {.draco_position_bits = 8}).value();
}

TEST_CASE("a cloud comes out of the confined decoder as it does without") {
  for (const Place place : {Place::kNearZero, Place::kFarFloat, Place::kFarDouble}) {
    const Cloud cloud = cloud_with_everything(2000, place).cloud;
    for (const auto format : {CloudFormat::kDraco, CloudFormat::kPly, CloudFormat::kXyz}) {
      const auto bytes = write_cloud(cloud, format, {}).value();
      const auto confined = read(bytes, format);
      INFO(why(confined));
      REQUIRE(confined.ok());
      const auto direct = read_cloud(bytes, format, {});
      CHECK(difference(confined.value().cloud, direct.value().cloud) == "");
      CHECK(confined.value().report.duplicate_count == direct.value().report.duplicate_count);
      CHECK(confined.value().report.encoding == direct.value().report.encoding);
      CHECK(confined.value().report.attributes == direct.value().report.attributes);
    }
  }
}

TEST_CASE("a large cloud fits into what the decoder is given") {
  const Cloud cloud = cloud_with_everything(300'000, Place::kFarDouble).cloud;
  for (const auto format : {CloudFormat::kDraco, CloudFormat::kPly, CloudFormat::kXyz}) {
    for (const int bits : {0, 14}) {
      if (bits > 0 && format != CloudFormat::kDraco) continue;
      const auto confined = read(write_cloud(cloud, format, {.draco_position_bits = bits}).value(), format);
      INFO(std::string(format_name(format)), ": ", why(confined));
      REQUIRE(confined.ok());
      CHECK(confined.value().cloud.size() == cloud.size());
    }
  }
}

TEST_CASE("errors cross over with all that they say") {
  const auto not_finite = read(bytes_of("1 2 3\nnan 5 6\n"), CloudFormat::kXyz);
  REQUIRE_FALSE(not_finite.ok());
  CHECK(not_finite.error().code == ErrorCode::kNonFinite);
  const auto dropped = read(bytes_of("1 2 3\nnan 5 6\n"), CloudFormat::kXyz, {.drop_non_finite = true});
  REQUIRE(dropped.ok());
  CHECK(dropped.value().report.dropped_non_finite == 1);
  const auto large = read(bytes_of("1 2 3\n4 5 6\n7 8 9\n"), CloudFormat::kXyz, {.max_samples = 2});
  REQUIRE_FALSE(large.ok());
  CHECK(large.error().code == ErrorCode::kTooLarge);
  CHECK(large.error().limit == 2.0);
  const auto broken = read(bytes_of("1 2 3\n4 5\n"), CloudFormat::kXyz);
  CHECK(broken.error().code == ErrorCode::kMalformedData);
  CHECK(broken.error().message.find("line 2") != std::string::npos);
  CHECK(read({}, CloudFormat::kPly).error().code == ErrorCode::kEmptyCloud);
}

TEST_CASE("bombs are refused without the daemon growing") {
  reset_peak_memory();
  const std::uint64_t before = peak_memory();
  const auto small = tiny_draco(40);
  REQUIRE(read(small, CloudFormat::kDraco).ok());
  for (const std::uint32_t count : {100'000'000U, 49'000'000U, 1'000'000U, 0x7fffffffU}) {
    const auto bomb = read(with_point_count(small, count), CloudFormat::kDraco);
    REQUIRE_FALSE(bomb.ok());
    CHECK(bomb.error().code == ErrorCode::kTooLarge);
  }
  // What the gate lets through costs the child at most what its size warrants.
  const auto most = static_cast<std::uint32_t>(small.size() * 1000);
  static_cast<void>(read(with_point_count(small, most), CloudFormat::kDraco).ok());
  CHECK(peak_memory() - before < (64U << 20));
}

TEST_CASE("memory, time and queue have their limits") {
  const auto bytes =
      write_cloud(sphere(200'000).cloud, CloudFormat::kDraco, {.draco_position_bits = 14}).value();
  if (!kSanitizedBuild) {
    ConfineLimits narrow = limits();
    narrow.memory_bytes = 1 << 20;
    const auto refused = decode_confined(bytes, CloudFormat::kDraco, {}, narrow);
    REQUIRE_FALSE(refused.ok());
    CHECK(refused.error().code == ErrorCode::kTooLarge);
  }
  ConfineLimits hasty = limits();
  hasty.deadline_seconds = 0.0;
  const auto late = decode_confined(bytes, CloudFormat::kDraco, {}, hasty);
  REQUIRE_FALSE(late.ok());
  CHECK(late.error().code == ErrorCode::kTooLarge);
  DecodeSlots slots(1);
  ConfineLimits queued = limits();
  queued.slots = &slots;
  queued.queue_seconds = 0.05;
  {
    const auto held = slots.acquire(std::chrono::seconds(1));
    const auto waiting = decode_confined(bytes, CloudFormat::kDraco, {}, queued);
    REQUIRE_FALSE(waiting.ok());
    CHECK(waiting.error().code == ErrorCode::kCancelled);
    CHECK(waiting.error().field == "decoder");
  }
  CHECK(decode_confined(bytes, CloudFormat::kDraco, {}, queued).ok());
  const ExecutionContext context;
  context.cancel();
  CHECK(decode_confined(bytes, CloudFormat::kDraco, {}, limits(), &context).error().code ==
        ErrorCode::kCancelled);
}

TEST_CASE("a decoder that cannot be started, or is no decoder, is the server's fault") {
  for (const char* program : {"/nonexistent/program", "/bin/true", "/bin/false"}) {
    ConfineLimits wrong = limits();
    wrong.program = program;
    const auto failed = decode_confined(bytes_of("1 2 3\n"), CloudFormat::kXyz, {}, wrong);
    CAPTURE(program);
    REQUIRE_FALSE(failed.ok());
  }
}

TEST_CASE("hundreds of damaged Draco files kill at most their decoder") {
  const std::size_t descriptors = open_descriptors();
  std::vector<std::vector<std::byte>> seeds{tiny_draco(30)};
  for (const int bits : {0, 11}) {
    seeds.push_back(write_cloud(cloud_with_everything(20, Place::kFarFloat).cloud, CloudFormat::kDraco,
                                {.draco_position_bits = bits})
                        .value());
  }
  reset_peak_memory();
  const std::uint64_t before = peak_memory();
  Random random(20);
  int sound = 0;
  for (int round = 0; round < 300; ++round) {
    auto mutant = seeds[random.below(seeds.size())];
    for (std::uint64_t flips = 1 + random.below(6); flips > 0; --flips) {
      mutant[5 + random.below(mutant.size() - 5)] = static_cast<std::byte>(random.next());
    }
    if (random.below(4) == 0) mutant.resize(random.below(mutant.size()) + 1);
    const auto result = read(mutant, CloudFormat::kDraco);
    if (!result.ok()) {
      CHECK(result.error().code != ErrorCode::kCancelled);
      continue;
    }
    CHECK(validate(result.value().cloud).ok());
    ++sound;
  }
  MESSAGE(sound, " of 300 damaged files still held a sound cloud");
  CHECK(peak_memory() - before < (64U << 20));
  CHECK(open_descriptors() == descriptors);
}

TEST_CASE("decoders run side by side from many threads") {
  const Cloud cloud = cloud_with_everything(500, Place::kNearZero).cloud;
  const auto bytes = write_cloud(cloud, CloudFormat::kDraco, {}).value();
  DecodeSlots slots(2);
  ConfineLimits shared = limits();
  shared.slots = &slots;
  std::vector<std::string> differences(6, "not read");
  {
    std::vector<std::jthread> threads;
    for (std::string& found : differences) {
      threads.emplace_back([&] {
        const auto result = read(bytes, CloudFormat::kDraco, {}, shared);
        if (result.ok()) found = difference(result.value().cloud, cloud);
      });
    }
  }
  for (const std::string& found : differences) CHECK(found == "");
}

}  // namespace
}  // namespace pointwright::io_test

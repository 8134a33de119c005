// A frame of a drag as a viewer meets it: the parameters go to the daemon, the frame comes over the stream.
#include <stdexcept>
#include <string>

#include "engine/io/cloud_io.h"
#include "protocol/frames/bytes.h"
#include "tests/acceptance/daemon.h"
#include "tests/acceptance/stream_reader.h"
#include "tests/bench/benchmarks.h"
#include "tests/bench/synthetic_scan.h"

namespace pointwright::bench {
namespace {

constexpr std::size_t kSequenceOffset = 24;  // in a frame's header (FRAMES.md)

// The sides that bench_frames.cpp paints: every sample between moves.
constexpr const char* kOneSide = R"({"mode":"add","shape":{"type":"box","min":[1.3,-2,-2],"max":[2,2,2]}})";
constexpr const char* kZeroSide =
    R"({"mode":"add","shape":{"type":"box","min":[-2,-2,-2],"max":[-1.39,2,2]}})";

std::string turn(std::uint64_t sequence) {
  const double angle_deg = 90.0 + 0.05 * static_cast<double>(sequence);
  return R"({"level":0,"blend":"quartic","deformation":{"type":"rotation","axis":{"point":[0,0,0],)"
         R"("direction":[0,1,0]},"angle_deg":)" +
         std::to_string(angle_deg) + R"(},"sequence":)" + std::to_string(sequence) + "}";
}

void expect(const test::Reply& reply, int status) {
  if (reply.status != status) throw std::runtime_error("the daemon refused: " + reply.body);
}

// Reads frames up to the preview's.
void wait_for(test::StreamReader& stream, std::uint64_t sequence) {
  while (true) {
    const auto record = stream.next_frame_record();
    if (!record) throw std::runtime_error("the stream ended");
    if (protocol::load<std::uint64_t>(record->payload, kSequenceOffset) == sequence) return;
  }
}

}  // namespace

void bench_http(BenchReport& report) {
  constexpr const char* kName = "frame.148k.http";
  if (!report.wants(kName)) return;
  constexpr std::size_t kSamples = 148'138;
  const auto file = write_cloud(ordered_scan(kSamples), CloudFormat::kPly, {});
  if (!file) throw std::runtime_error(file.error().message);
  test::Daemon daemon;
  const test::Reply uploaded =
      daemon.upload({reinterpret_cast<const char*>(file.value().data()), file.value().size()});
  expect(uploaded, 201);
  const std::string session = daemon.open_session(uploaded.json()["id"], nlohmann::json(kThreeScales).dump());
  expect(daemon.ask("POST", session + "/regions/one/operations", kOneSide), 200);
  expect(daemon.ask("POST", session + "/regions/zero/operations", kZeroSide), 200);
  test::StreamReader stream(daemon, session + "/stream?attributes=normal,t");
  std::uint64_t sequence = 0;
  report.time(kName, "ms", static_cast<double>(kSamples), [&] {
    ++sequence;
    expect(daemon.ask("PUT", session + "/preview", turn(sequence)), 204);
    wait_for(stream, sequence);
  });
}

}  // namespace pointwright::bench

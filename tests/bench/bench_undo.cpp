// Undo and redo of one edit, and the memory of hundreds of them.
#include <cstdlib>
#include <string>

#include "engine/core/parallel.h"
#include "server/sessions/history.h"
#include "tests/bench/benchmarks.h"
#include "tests/bench/synthetic_scan.h"

namespace pointwright::bench {
namespace {

using server::History;
using server::RecordedEdit;
using server::SurfaceState;

constexpr std::size_t kEdits = 300;
constexpr std::size_t kTenths = 10;

// The scan on four levels; what stands in the columns does not matter, that its bits are those of a surface
// does.
SurfaceState rest_state(const Cloud& scan) {
  auto surface = std::make_shared<MultiresSurface>();
  const Level level{.position = scan.position, .normal = scan.position};
  surface->levels.assign(kThreeScales.size() + 1, level);
  surface->detail.assign(kThreeScales.size(), std::vector<float>(scan.size(), 0.01F));
  return {.surface = std::move(surface), .reports = nullptr, .first_valid_level = 0};
}

// Samples [begin, end) of every level turned by `angle`.
SurfaceState turned(const SurfaceState& state, std::size_t begin, std::size_t end, float angle) {
  auto surface = std::make_shared<MultiresSurface>(*state.surface);
  const Mat3f rotation = Eigen::AngleAxisf(angle, Vec3f(1, 2, 3).normalized()).toRotationMatrix();
  for (Level& level : surface->levels) {
    for (Points* points : {&level.position, &level.normal})
      parallel_for(end - begin, [&](std::size_t from, std::size_t to) {
        for (std::size_t i = begin + from; i < begin + to; ++i) points->set(i, rotation * (*points)[i]);
      });
  }
  return {.surface = std::move(surface), .reports = nullptr, .first_valid_level = 0};
}

History::Work no_work() {
  return {.replay = [](const SurfaceState&, const RecordedEdit&) -> Result<SurfaceState> { std::abort(); },
          .derive = [](const SurfaceState&) -> Result<SurfaceState> { std::abort(); }};
}

void push(History& history, std::size_t begin, std::size_t end) {
  auto edit = std::make_shared<RecordedEdit>();
  edit->index = history.head() + 1;
  edit->marks = std::make_shared<const Marks>(history.current().surface->sample_count());
  SurfaceState after = turned(history.current(), begin, end, 0.1F);
  history.push(std::move(edit), std::move(after));
}

void bench_size(BenchReport& report, const std::string& label, std::size_t n, std::size_t edits) {
  const std::string name = "undo." + label;
  if (!report.wants(name)) return;
  const SurfaceState rest = rest_state(ordered_scan(n));
  const auto items = static_cast<double>(n);
  for (const std::size_t parts : {std::size_t{1}, kTenths}) {
    History history(rest, 1ULL << 40U, no_work());
    push(history, 0, n);
    push(history, 0, n / parts);
    // An undo and a redo; each run is two steps.
    report.time(name + (parts == 1 ? ".all" : ".tenth"), "ms/2", items, [&] {
      if (!history.move_head(1) || !history.move_head(2)) std::abort();
    });
  }
  if (edits == 0) return;
  History history(rest, 1ULL << 40U, no_work());
  for (std::size_t i = 0; i < edits; ++i) {
    const std::size_t begin = (i * 7 % kTenths) * n / kTenths;
    push(history, begin, begin + n / kTenths);
  }
  report.add(name + ".300_edits_of_a_tenth", "B", items, static_cast<double>(history.memory()));
  report.time(name + ".300_back_and_forth", "ms", items, [&] {
    if (!history.move_head(0) || !history.move_head(edits)) std::abort();
  });
}

}  // namespace

void bench_undo(BenchReport& report) {
  bench_size(report, "150k", 150'000, kEdits);
  bench_size(report, "2m", 2'000'000, 0);
}

}  // namespace pointwright::bench

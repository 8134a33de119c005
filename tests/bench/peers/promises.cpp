#include <algorithm>
#include <cstdio>

#include "tests/bench/peers/comparison.h"

namespace pointwright::peers {
namespace {

using Measure = double (*)(const Simplified&);

double to_set(const Simplified& row) {
  return row.to_set.rms;
}
double to_surface(const Simplified& row) {
  return row.to_surface.rms;
}

bool has(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

// Rounding of float positions is no distance: a ten-millionth of the diagonal, in millionths.
constexpr double kRounding = 0.1;

class Promises {
 public:
  Promises(std::string model, std::span<const Simplified> results, bench::BenchReport& report)
      : model_(std::move(model)), results_(results), report_(report) {}

  // Ours is at most `factor` times the least that any method with this part in its name reaches.
  void at_most(double factor, const std::string& peer, Measure measure, const std::string& sentence) {
    const Simplified* ours = nullptr;
    const Simplified* best = nullptr;
    for (const Simplified& row : results_) {
      if (row.method == "ours") ours = &row;
      const bool is_peer = peer.empty() ? !has(row.method, "ours") : has(row.method, peer);
      if (is_peer && (best == nullptr || measure(row) < measure(*best))) best = &row;
    }
    if (ours == nullptr || best == nullptr) return;
    const double allowed = std::max(factor * measure(*best), kRounding);
    const bool holds = measure(*ours) <= allowed;
    std::printf("  %-6s  %s: %.2f, allowed %.2f (%s: %.2f)\n", holds ? "PASS" : "MISSED", sentence.c_str(),
                measure(*ours), allowed, best->method.c_str(), measure(*best));
    report_.record("promise." + model_ + "." + sentence, "bool", static_cast<double>(ours->count),
                   holds ? 1.0 : 0.0);
  }

 private:
  std::string model_;
  std::span<const Simplified> results_;
  bench::BenchReport& report_;
};

}  // namespace

void check_promises(const std::string& model, std::span<const Simplified> results,
                    bench::BenchReport& report) {
  Promises promises(model, results, report);
  promises.at_most(0.5, "voxel", to_surface, "samples at most half as far from the surface as voxel grids'");
  promises.at_most(1.0, "mesh", to_surface, "samples no farther from the surface than mesh quadrics'");
  promises.at_most(1.0, "mesh", to_set, "originals no farther from the set than from mesh quadrics'");
  if (has(model, "steps")) {
    // Methods that keep some of the originals are at distance 0 by construction, and so are vertices of a
    // mesh that are never moved.
    for (const char* moving : {"voxel", "WLOP"}) {
      promises.at_most(1.0, moving, to_surface,
                       "samples nearer to flats and edges than moved ones of any peer");
    }
    promises.at_most(1.0, "", to_set, "originals of flats and edges nearer to the set than to any peer's");
  }
  promises.at_most(1.05, "greedy", to_surface, "batched samples within 5 % of greedy ones");
  promises.at_most(1.05, "greedy", to_set,
                   "originals within 5 % as near to the batched set as to the greedy");
}

}  // namespace pointwright::peers

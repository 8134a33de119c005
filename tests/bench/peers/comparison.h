#pragma once
// The comparisons: every library's work on the same input in one run.

#include <functional>
#include <span>
#include <string>
#include <vector>

#include "tests/bench/bench.h"
#include "tests/bench/peers/library.h"
#include "tests/support/surface_distance.h"

namespace pointwright::peers {

/// 10 nearest neighbours and normals of `samples` samples of the scan, in random and in coherent order. The
/// libraries take turns; figures are medians. Says where a library's answer is not that of the others.
void compare_searches(std::span<const Library> libraries, std::size_t samples, bench::BenchReport& report);

/// A simplified set against the original, as lengths in millionths of the model's diagonal.
struct Simplified {
  std::string method;
  std::size_t count = 0;
  double ms = 0.0;
  test::DistanceSummary to_set;      ///< from the original samples to the planes of the simplified ones
  test::DistanceSummary to_surface;  ///< from the simplified samples to the original surface
};

/// Every method that finishes within a minute, at about `count` samples.
std::vector<Simplified> compare_simplifiers(std::span<const Library> libraries, const Model& model,
                                            std::size_t count, bench::BenchReport& report);

/// Prints what we promise of simplification, whether it holds on this model, and by how much.
void check_promises(const std::string& model, std::span<const Simplified> results,
                    bench::BenchReport& report);

}  // namespace pointwright::peers

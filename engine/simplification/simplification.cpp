// Garland and Heckbert, "Surface simplification using quadric error metrics", 1997, on neighbourhoods instead
// of a mesh (§3.2).
#include "engine/simplification/simplification.h"

#include <algorithm>
#include <atomic>
#include <bit>
#include <cmath>
#include <functional>
#include <iterator>
#include <numeric>
#include <optional>
#include <utility>

#include "engine/core/out_of_range.h"
#include "engine/core/parallel.h"
#include "engine/simplification/contraction.h"

namespace pointwright {
namespace {

constexpr std::size_t kMaxSamples = (std::size_t{1} << 27U) - 1;  // node offsets are 31 bits
constexpr float kMaxLengthWeight = 10.0F;

// The log in order of cost, its first `count` contractions; lengths back in model units.
ContractionRecord ordered_record(const ContractionLog& log, std::size_t count, float scale) {
  std::vector<std::uint64_t> keys(log.count);
  std::vector<std::uint32_t> order(log.count);
  // Costs are not negative, so their bits order them; the sort is stable and no step costs less than those
  // that it builds on, which were made before it.
  parallel_for(log.count, [&](std::size_t begin, std::size_t end) {
    for (std::size_t s = begin; s < end; ++s) {
      keys[s] = std::bit_cast<std::uint32_t>(log.steps[s].cost);
      order[s] = static_cast<std::uint32_t>(s);
    }
  });
  sort_by_key(keys, order);
  ContractionRecord record;
  record.neighbor_first.resize(count + 1);
  // The log's lines are anywhere in memory: asked for long before they are read.
  constexpr std::size_t kAhead = 16;
  parallel_for(count, [&](std::size_t begin, std::size_t end) {
    for (std::size_t s = begin; s < end; ++s) {
      if (s + kAhead < end) __builtin_prefetch(&log.steps[order[s + kAhead]]);
      record.neighbor_first[s + 1] = log.steps[order[s]].neighbor_count;
    }
  });
  std::partial_sum(record.neighbor_first.begin(), record.neighbor_first.end(), record.neighbor_first.begin());
  // Zeroing the columns is what costs most in their first use: several at a time.
  const std::function<void()> columns[] = {
      [&] { record.neighbor.resize(record.neighbor_first[count]); }, [&] { record.steps.resize(count); },
      [&] { record.position.resize(count); }, [&] { record.normal.resize(count); }};
  parallel_for(
      std::size(columns), [&](std::size_t c, std::size_t) { columns[c](); }, 1);
  const float inverse = 1.0F / scale;
  parallel_for(count, [&](std::size_t begin, std::size_t end) {
    for (std::size_t s = begin; s < end; ++s) {
      if (s + 2 * kAhead < end) __builtin_prefetch(&log.steps[order[s + 2 * kAhead]]);
      if (s + kAhead < end) __builtin_prefetch(&log.neighbors[log.steps[order[s + kAhead]].first_neighbor]);
      const ContractionLog::Step& step = log.steps[order[s]];
      const float* p = step.position;
      record.steps[s] = step.contraction;
      record.steps[s].error *= inverse;
      record.position.set(s, {p[0] * inverse, p[1] * inverse, p[2] * inverse});
      record.normal.set(s, {step.normal[0], step.normal[1], step.normal[2]});
      std::copy_n(&log.neighbors[step.first_neighbor], step.neighbor_count,
                  record.neighbor.data() + record.neighbor_first[s]);
    }
  });
  return record;
}

// Normals of what a sample stands for, as 1 - |mean|^2: from here on it is a crease and stays where it is.
constexpr double kCrease = 0.3;

// Placement::kOnSurface. On z = x' C x / 2 the tangent planes of a patch around 0 meet 0's normal at -E/2 on
// average and its samples lie E/2 above, E the mean of x' C x.
void settle(const Points& position, const Points& normal, Simplification& result) {
  struct Sum {
    Vec3d position = Vec3d::Zero();
    Vec3d normal = Vec3d::Zero();
    double count = 0.0;
  };
  // Every range of survivors goes over the samples from its first on: survivors are the first of their own.
  constexpr std::size_t kRanges = 4;
  const std::size_t kept = result.kept.size();
  std::vector<Sum> sums(kept);
  const auto sum_up = [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = result.kept[begin]; i < position.size(); ++i) {
      const std::uint32_t m = result.parent[i];
      if (m < begin || m >= end) continue;
      Sum& sum = sums[m];
      sum.position += position[i].cast<double>();
      const double side = normal[i].dot(result.normal[m]) < 0.0F ? -1.0 : 1.0;
      sum.normal += side * normal[i].cast<double>();
      sum.count += 1.0;
    }
  };
  parallel_for(kept, sum_up, (kept + kRanges - 1) / kRanges);
  parallel_for(sums.size(), [&](std::size_t begin, std::size_t end) {
    for (std::size_t m = begin; m < end; ++m) {
      const Sum& sum = sums[m];
      if (sum.count < 2.0) continue;
      const double spread = 1.0 - (sum.normal / sum.count).squaredNorm();
      const double share = 0.5 * std::max(0.0, 1.0 - spread / kCrease);
      const Vec3d p = result.position[m].cast<double>();
      const Vec3d n = result.normal[m].cast<double>();
      result.position.set(m, (p + share * n.dot(sum.position / sum.count - p) * n).cast<float>());
    }
  });
}

// The greatest of all offers, whatever their order.
void raise(std::uint32_t& value, std::uint32_t offer) {
  const std::atomic_ref<std::uint32_t> ref(value);
  std::uint32_t current = ref.load(std::memory_order_relaxed);
  while (current < offer && !ref.compare_exchange_weak(current, offer, std::memory_order_relaxed)) {
  }
}

// Every column of the result but the record, which has all the contractions to be done.
void apply_record(const Points& position, const Points& normal, Simplification& result) {
  const std::size_t n = position.size();
  const ContractionRecord& record = result.record;
  const auto last_step = make_large_array<std::uint32_t>(n);  // + 1; 0 for none
  const auto survivor = make_large_array<std::uint32_t>(n);
  parallel_for(n, [&](std::size_t begin, std::size_t end) {
    std::fill(last_step.get() + begin, last_step.get() + end, 0U);
    std::iota(survivor.get() + begin, survivor.get() + end, static_cast<std::uint32_t>(begin));
  });
  parallel_for(record.steps.size(), [&](std::size_t begin, std::size_t end) {
    for (std::size_t s = begin; s < end; ++s) {
      const Contraction& step = record.steps[s];
      survivor[step.removed] = step.survivor;
      raise(last_step[step.survivor], static_cast<std::uint32_t>(s + 1));
    }
  });
  result.parent.resize(n);
  for (std::uint32_t i = 0; i < n; ++i) {
    if (survivor[i] == i) {
      result.parent[i] = static_cast<std::uint32_t>(result.kept.size());
      result.kept.push_back(i);
    } else {
      result.parent[i] = result.parent[survivor[i]];  // which comes before i
    }
  }
  result.position.resize(result.kept.size());
  result.normal.resize(result.kept.size());
  parallel_for(result.kept.size(), [&](std::size_t begin, std::size_t end) {
    for (std::size_t m = begin; m < end; ++m) {
      const std::uint32_t i = result.kept[m];
      const std::uint32_t steps = last_step[i];
      result.position.set(m, steps == 0 ? position[i] : record.position[steps - 1]);
      result.normal.set(m, steps == 0 ? normal[i] : record.normal[steps - 1]);
    }
  });
  if (result.placement == Placement::kOnSurface && !record.steps.empty()) settle(position, normal, result);
}

// Contractions down to `count` samples, or as far as the parameters let them go; nothing where cancelled.
std::optional<ContractionRecord> contraction_record(const Points& position, const Points& normal,
                                                    const NeighborGraph& graph, const SimplifyParams& params,
                                                    std::size_t count, const ExecutionContext* context) {
  ContractionLog log;
  float scale = 1.0F;
  {  // the log is ordered when the nodes' memory is free again
    ContractionNodes nodes(position, normal, graph, params.separate_sheets, context);
    scale = nodes.scale();
    ContractionGoal goal{.count = count};
    goal.rule.length_weight = params.length_weight;
    goal.rule.separate_sheets = params.separate_sheets;
    if (const auto* within = std::get_if<KeepWithin>(&params.target)) {
      goal.rule.limit = within->error * scale * (within->error * scale);
    }
    const auto contract = params.order == ContractionOrder::kGreedy ? contract_greedily : contract_in_batches;
    if (!contract(position, graph, goal, nodes, log, context)) return std::nullopt;
  }
  return ordered_record(log, std::min(log.count, position.size() - count), scale);
}

}  // namespace

std::size_t kept_of(const KeepCount& target, std::size_t sample_count) {
  return std::min(sample_count, target.count);
}

std::size_t kept_of(const KeepRatio& target, std::size_t sample_count) {
  const auto rounded =
      static_cast<std::size_t>(std::llround(target.ratio * static_cast<double>(sample_count)));
  return std::min(sample_count, std::max<std::size_t>(1, rounded));
}

Result<void> validate(const SimplifyParams& params) {
  if (const auto* keep = std::get_if<KeepCount>(&params.target); keep != nullptr && keep->count < 1) {
    return out_of_range("at least one sample must be kept", "target.count", 1, 0);
  }
  if (const auto* keep = std::get_if<KeepRatio>(&params.target);
      keep != nullptr && !(keep->ratio > 0.0 && keep->ratio <= 1.0)) {
    return out_of_range("the ratio must lie in (0, 1]", "target.ratio", 1, keep->ratio);
  }
  if (const auto* keep = std::get_if<KeepWithin>(&params.target);
      keep != nullptr && !(keep->error >= 0.0F && std::isfinite(keep->error))) {
    return out_of_range("the error must be finite and not negative", "target.error", 0,
                        static_cast<double>(keep->error));
  }
  if (!(params.length_weight >= 0.0F && params.length_weight <= kMaxLengthWeight)) {
    return out_of_range("length_weight must lie between 0 and 10", "length_weight",
                        static_cast<double>(kMaxLengthWeight), static_cast<double>(params.length_weight));
  }
  return {};
}

Result<Simplification> simplify(const Points& position, const Points& normal, const NeighborGraph& graph,
                                const SimplifyParams& params, const ExecutionContext* context) {
  if (const auto valid = validate(params); !valid) return valid.error();
  const std::size_t n = position.size();
  POINTWRIGHT_CHECK(graph.count == n && normal.size() == n, "normals and graph must be of these points");
  if (n > kMaxSamples) {
    return too_large("too many samples to simplify at once", "position", static_cast<double>(kMaxSamples),
                     static_cast<double>(n));
  }
  Simplification result{.placement = params.placement};
  result.record.neighbor_first.assign(1, 0);
  if (n == 0) return result;
  std::size_t count = 1;
  if (const auto* keep = std::get_if<KeepCount>(&params.target)) count = kept_of(*keep, n);
  if (const auto* keep = std::get_if<KeepRatio>(&params.target)) count = kept_of(*keep, n);
  if (count < n) {
    auto record = contraction_record(position, normal, graph, params, count, context);
    if (!record) return cancelled_error();
    result.record = std::move(*record);
  }
  apply_record(position, normal, result);
  return result;
}

Simplification reinsert(const Simplification& simplified, const Points& position, const Points& normal,
                        std::size_t count) {
  const std::size_t n = position.size();
  POINTWRIGHT_CHECK(simplified.parent.size() == n && normal.size() == n,
                    "these are not the simplified points");
  POINTWRIGHT_CHECK(count >= simplified.kept.size() && count <= n, "only what was removed can come back");
  Simplification result{.placement = simplified.placement};
  const ContractionRecord& record = simplified.record;
  const std::size_t steps = n - count;
  const auto first_of = [](const auto& column, std::size_t length) {
    return std::vector(column.begin(), column.begin() + static_cast<std::ptrdiff_t>(length));
  };
  result.record.steps = first_of(record.steps, steps);
  result.record.position.resize(steps);
  result.record.normal.resize(steps);
  for (std::size_t s = 0; s < steps; ++s) {
    result.record.position.set(s, record.position[s]);
    result.record.normal.set(s, record.normal[s]);
  }
  result.record.neighbor_first = first_of(record.neighbor_first, steps + 1);
  result.record.neighbor = first_of(record.neighbor, record.neighbor_first[steps]);
  apply_record(position, normal, result);
  return result;
}

Neighborhoods neighborhoods(const Simplification& simplified, const NeighborGraph& graph) {
  const ContractionRecord& record = simplified.record;
  POINTWRIGHT_CHECK(graph.count == simplified.parent.size(),
                    "the graph is not that of the simplified points");
  constexpr std::uint32_t kNone = 0xffffffffU;
  std::vector<std::uint32_t> last_step(graph.count, kNone);
  for (std::size_t s = 0; s < record.steps.size(); ++s) {
    last_step[record.steps[s].survivor] = static_cast<std::uint32_t>(s);
  }
  std::vector<std::vector<std::uint32_t>> rows(simplified.kept.size());
  for (std::uint32_t m = 0; m < rows.size(); ++m) {
    const std::uint32_t i = simplified.kept[m];
    const auto join = [&](std::uint32_t other) {
      const std::uint32_t x = simplified.parent[other];
      if (x == m) return;
      rows[m].push_back(x);
      rows[x].push_back(m);
    };
    if (const std::uint32_t s = last_step[i]; s != kNone) {
      std::for_each(record.neighbor.begin() + static_cast<std::ptrdiff_t>(record.neighbor_first[s]),
                    record.neighbor.begin() + static_cast<std::ptrdiff_t>(record.neighbor_first[s + 1]),
                    join);
    } else {
      for (std::uint32_t j = 0; j < std::min(graph.k, kStartNeighbors); ++j) join(graph.index(i, j));
    }
  }
  Neighborhoods result;
  result.first.assign(1, 0);
  for (std::vector<std::uint32_t>& row : rows) {
    std::sort(row.begin(), row.end());
    result.neighbor.insert(result.neighbor.end(), row.begin(), std::unique(row.begin(), row.end()));
    result.first.push_back(result.neighbor.size());
  }
  return result;
}

}  // namespace pointwright

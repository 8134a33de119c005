// The reference order: the cheapest pair of all, one at a time, over complete neighbourhoods (§3.2: "works
// exactly like mesh decimation").
#include <algorithm>
#include <cmath>
#include <numeric>
#include <queue>

#include "engine/simplification/contraction.h"

namespace pointwright {
namespace {

constexpr std::size_t kContractionsPerLook = 4096;  // whether it was cancelled

class Greedy {
 public:
  Greedy(const NeighborGraph& graph, const ContractionGoal& goal, ContractionNodes& nodes,
         ContractionLog& log, const ExecutionContext* context)
      : goal_(goal),
        nodes_(nodes),
        log_(log),
        context_(context),
        adjacent_(graph.count),
        version_(graph.count, 0),
        node_cost_(graph.count, 0.0F),
        is_live_(graph.count, true),
        id_(graph.count) {
    std::iota(id_.begin(), id_.end(), 0U);
  }

  bool run(const Points& position, const NeighborGraph& graph) {
    log_.steps = make_large_array<ContractionLog::Step>(position.size() - goal_.count);
    connect(position, graph);
    for (std::size_t left = position.size(); left > goal_.count; --left) {
      if (log_.count % kContractionsPerLook == 0 && is_cancelled()) return false;
      if (!drop_outdated()) {
        keep_live();
        const SurvivorGraph survivors = survivor_graph(nodes_, context_);
        if (is_cancelled()) return false;
        connect(survivors.position, survivors.graph);
        if (!drop_outdated()) break;
      }
      const Candidate best = heap_.top();
      heap_.pop();
      contract(best);
    }
    log_.neighbors = make_large_array<std::uint32_t>(neighbors_.size());
    std::copy(neighbors_.begin(), neighbors_.end(), log_.neighbors.get());
    return !is_cancelled();
  }

 private:
  struct Candidate {
    float cost = 0.0F;
    std::uint64_t tie = 0;
    std::uint32_t first = 0, second = 0;
    std::uint32_t first_version = 0, second_version = 0;
    friend bool operator<(const Candidate& a, const Candidate& b) {  // the heap's top is the cheapest
      return a.cost != b.cost ? a.cost > b.cost : a.tie > b.tie;
    }
  };

  [[nodiscard]] bool is_cancelled() const { return context_ != nullptr && context_->is_cancelled(); }

  // Numbers the samples that are left anew.
  void keep_live() {
    std::vector<std::uint32_t> live;
    for (std::uint32_t i = 0; i < id_.size(); ++i) {
      if (is_live_[i]) live.push_back(i);
    }
    nodes_.compact(live.data(), live.size());
    for (std::size_t l = 0; l < live.size(); ++l) {
      id_[l] = id_[live[l]];
      node_cost_[l] = node_cost_[live[l]];
    }
    id_.resize(live.size());
    is_live_.assign(live.size(), true);
    heap_ = {};
  }

  // Symmetric neighbourhoods from a graph over the samples that are left.
  void connect(const Points& position, const NeighborGraph& graph) {
    adjacent_.assign(id_.size(), {});
    std::uint32_t row[kRowNeighbors];
    for (std::uint32_t i = 0; i < id_.size(); ++i) {
      const std::uint32_t length = starting_row(position, graph, i, row);
      for (std::uint32_t s = 0; s < length; ++s) {
        adjacent_[i].push_back(row[s]);
        adjacent_[row[s]].push_back(i);
      }
    }
    for (std::uint32_t i = 0; i < id_.size(); ++i) {
      std::vector<std::uint32_t>& row_i = adjacent_[i];
      std::sort(row_i.begin(), row_i.end());
      row_i.erase(std::unique(row_i.begin(), row_i.end()), row_i.end());
      offer(i, {std::upper_bound(row_i.begin(), row_i.end(), i), row_i.end()});
    }
  }

  void offer(std::uint32_t i, const std::vector<std::uint32_t>& others) {
    first_.clear();
    second_.clear();
    for (const std::uint32_t other : others) {
      first_.push_back(std::min(i, other));
      second_.push_back(std::max(i, other));
    }
    first_.resize(padded_to_block(others.size()), 0U);
    second_.resize(first_.size(), 0U);
    cost_.resize(first_.size());
    nodes_.costs(goal_.rule, first_.data(), second_.data(), others.size(), cost_.data());
    for (std::size_t o = 0; o < others.size(); ++o) {
      if (!(cost_[o] < std::numeric_limits<float>::infinity())) continue;
      heap_.push({cost_[o], tie_key(id_[first_[o]], id_[second_[o]]), first_[o], second_[o],
                  version_[first_[o]], version_[second_[o]]});
    }
  }

  // Whether there is a pair left.
  bool drop_outdated() {
    while (!heap_.empty()) {
      const Candidate& top = heap_.top();
      if (is_live_[top.first] && is_live_[top.second] && version_[top.first] == top.first_version &&
          version_[top.second] == top.second_version) {
        return true;
      }
      heap_.pop();
    }
    return false;
  }

  void contract(const Candidate& pair) {
    const std::uint32_t a = pair.first;
    const std::uint32_t b = pair.second;
    std::uint32_t first[kSimdBlock] = {a};
    std::uint32_t second[kSimdBlock] = {b};
    ContractionNode merged[kSimdBlock];
    nodes_.contract(first, second, 1, merged);
    nodes_.set(a, merged[0]);
    const float* f = merged[0].fields;
    node_cost_[a] = std::max({pair.cost, node_cost_[a], node_cost_[b]});
    std::vector<std::uint32_t> joined;
    std::set_union(adjacent_[a].begin(), adjacent_[a].end(), adjacent_[b].begin(), adjacent_[b].end(),
                   std::back_inserter(joined));
    std::erase_if(joined, [&](std::uint32_t x) { return x == a || x == b; });
    for (const std::uint32_t x : joined) {
      std::vector<std::uint32_t>& row = adjacent_[x];
      std::erase_if(row, [&](std::uint32_t y) { return y == a || y == b; });
      row.insert(std::upper_bound(row.begin(), row.end(), a), a);
    }
    log_.steps[log_.count++] = {.contraction = {id_[a], id_[b], std::sqrt(f[12])},
                                .cost = node_cost_[a],
                                .position = {f[0], f[1], f[2]},
                                .normal = {f[13], f[14], f[15]},
                                .neighbor_count = static_cast<std::uint32_t>(joined.size()),
                                .first_neighbor = neighbors_.size()};
    for (const std::uint32_t x : joined) neighbors_.push_back(id_[x]);
    is_live_[b] = false;
    ++version_[a];
    adjacent_[b] = {};
    offer(a, joined);
    adjacent_[a] = std::move(joined);
  }

  const ContractionGoal& goal_;
  ContractionNodes& nodes_;
  ContractionLog& log_;
  const ExecutionContext* context_;
  std::vector<std::vector<std::uint32_t>> adjacent_;  // symmetric, ascending
  std::vector<std::uint32_t> version_;
  std::vector<float> node_cost_;
  std::vector<bool> is_live_;
  std::vector<std::uint32_t> id_;         // indices into the input, ascending
  std::vector<std::uint32_t> neighbors_;  // the log's
  std::priority_queue<Candidate> heap_;
  std::vector<std::uint32_t> first_, second_;  // buffers
  std::vector<float> cost_;
};

}  // namespace

bool contract_greedily(const Points& position, const NeighborGraph& graph, const ContractionGoal& goal,
                       ContractionNodes& nodes, ContractionLog& log, const ExecutionContext* context) {
  return Greedy(graph, goal, nodes, log, context).run(position, graph);
}

}  // namespace pointwright

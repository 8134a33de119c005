// Contraction in rounds of independent pairs. Quadrics only grow, so a pair that is the cheapest of both its
// samples stays so whatever is contracted elsewhere: Q_a + Q_b + Q_x is nowhere less than Q_a + Q_x. All such
// pairs may therefore go at once, as reciprocal nearest neighbours do in hierarchical clustering, and give
// the same tree of contractions as the greedy order; the order of costs then says where the tree is cut.
#include <algorithm>
#include <bit>
#include <cmath>
#include <numeric>
#include <tuple>
#include <vector>

#include "engine/core/parallel.h"
#include "engine/simplification/contraction.h"

namespace pointwright {
namespace {

constexpr std::size_t kBlock = 1024;  // nodes of a parallel block
// Rounds contract this much beyond the goal, of the samples to be left; the cheapest contractions of all
// count. What is dear in an early round can be cheap beside what comes later.
constexpr double kSurplus = 0.5;

// A contracted pair goes on as its first node; the second one's place is empty until half of all are.
class Batches {
 public:
  Batches(const ContractionGoal& goal, ContractionNodes& nodes, ContractionLog& log,
          const ExecutionContext* context)
      : goal_(goal), nodes_(nodes), log_(log), context_(context) {
    set_room(nodes.count());
    id_ = make_large_array<std::uint32_t>(count_);
    made_at_ = make_large_array<float>(count_);
    cost_ = make_large_array<float>(count_);
    rows_ = make_large_array<ContractionRow>(count_);
    for (auto* column : {&key_, &partner_, &mate_, &step_}) *column = make_large_array<std::uint32_t>(count_);
    std::iota(id_.get(), id_.get() + count_, 0U);
    std::fill_n(made_at_.get(), count_, 0.0F);
  }

  bool run(const Points& position, const NeighborGraph& graph) {
    const bool is_bounded = goal_.rule.limit < std::numeric_limits<float>::infinity();
    const auto surplus =
        static_cast<std::size_t>(is_bounded ? 0.0 : kSurplus * static_cast<double>(goal_.count));
    const std::size_t least = std::max<std::size_t>(goal_.count - surplus, 1);
    log_.steps = make_large_array<ContractionLog::Step>(count_ - least);
    log_.neighbors = make_large_array<std::uint32_t>((count_ - least) * kRowNeighbors);
    start_rows(position, graph);
    bool is_new_graph = false;
    while (count_ > least) {
      if (is_cancelled()) return false;
      if (find_pairs(count_ - least)) {
        is_new_graph = false;
        contract();
        update_rows();
        if (2 * count_ <= room_) compact();
      } else {
        if (is_new_graph || count_ <= goal_.count) break;
        is_new_graph = true;
        compact();
        const SurvivorGraph left = survivor_graph(nodes_, context_);
        if (is_cancelled()) return false;
        start_rows(left.position, left.graph);
      }
    }
    return !is_cancelled();
  }

 private:
  [[nodiscard]] bool is_cancelled() const { return context_ != nullptr && context_->is_cancelled(); }

  // `count` nodes, all of them live.
  void set_room(std::size_t count) {
    room_ = count_ = count;
    live_ = make_large_array<std::uint32_t>(padded_to_block(count));
    next_live_ = make_large_array<std::uint32_t>(padded_to_block(count));
    forward_ = make_large_array<std::uint32_t>(count);
    std::iota(live_.get(), live_.get() + count, 0U);
    std::iota(forward_.get(), forward_.get() + count, 0U);
    pad_live();
  }
  // With the last one: lanes of one block write what belongs to it, whatever other threads do.
  void pad_live() {
    std::fill(live_.get() + count_, live_.get() + padded_to_block(count_), live_[count_ - 1]);
  }

  // Rows from a graph over the samples that are left, which are all there is room for.
  void start_rows(const Points& position, const NeighborGraph& graph) {
    parallel_for(
        count_,
        [&](std::size_t begin, std::size_t end) {
          for (std::size_t i = begin; i < end; ++i) {
            std::uint32_t* const row = rows_[i].neighbor;
            const std::uint32_t length =
                starting_row(position, graph, i, std::span<std::uint32_t, kRowNeighbors>(row, kRowNeighbors));
            std::fill(row + length, row + kRowNeighbors, static_cast<std::uint32_t>(i));
          }
        },
        kBlock, context_);
    parallel_for(
        count_, [&](std::size_t begin, std::size_t end) { rate(live_.get() + begin, end - begin); }, kBlock,
        context_);
  }

  // Finds the cheapest pairs of the nodes in the list over their own rows. The list is padded.
  void rate(const std::uint32_t* list, std::size_t count) {
    POINTWRIGHT_KERNEL(best_partners_kernel)
    ({.nodes = nodes_.data(),
      .rows = rows_[0].neighbor,
      .live = list,
      .rule = goal_.rule,
      .cost = cost_.get(),
      .key = key_.get(),
      .partner = partner_.get()},
     0, padded_to_block(count));
  }

  // Marks the pairs that are the cheapest of both their samples in mate_, the cheapest `most` of them.
  // Returns whether there is any.
  bool find_pairs(std::size_t most) {
    accept_offers();
    const auto mark = [&](std::size_t begin, std::size_t end) {
      std::size_t found = 0;
      for (std::size_t l = begin; l < end; ++l) {
        const std::uint32_t i = live_[l];
        const std::uint32_t j = partner_[i];
        const bool is_mutual = j != kNoNode && partner_[j] == i;
        mate_[i] = is_mutual ? j : kNoNode;
        found += is_mutual && i < j ? 1 : 0;
      }
      return found;
    };
    const std::size_t pairs = parallel_sum<std::size_t>(count_, 0, mark, kBlock);
    if (pairs > most) keep_cheapest(pairs, most);
    return pairs > 0;
  }

  // Rows need not be symmetric: a node that is listed by one that it does not list itself learns so here
  // where that makes its cheapest pair.
  void accept_offers() {
    struct Offer {
      float cost;
      std::uint32_t key, from, to;
    };
    const auto is_better = [&](const Offer& offer) {
      return std::tuple(offer.cost, offer.key, offer.from) <
             std::tuple(cost_[offer.to], key_[offer.to], partner_[offer.to]);
    };
    std::vector<std::vector<Offer>> offers((count_ + kBlock - 1) / kBlock);
    parallel_for(
        count_,
        [&](std::size_t begin, std::size_t end) {
          for (std::size_t l = begin; l < end; ++l) {
            const std::uint32_t i = live_[l];
            const std::uint32_t j = partner_[i];
            if (j == kNoNode || partner_[j] == i) continue;
            const Offer offer{cost_[i], key_[i], i, j};
            if (is_better(offer)) offers[begin / kBlock].push_back(offer);
          }
        },
        kBlock);
    for (const auto& part : offers) {
      for (const Offer& offer : part) {
        if (!is_better(offer)) continue;
        cost_[offer.to] = offer.cost;
        key_[offer.to] = offer.key;
        partner_[offer.to] = offer.from;
      }
    }
  }

  void keep_cheapest(std::size_t pairs, std::size_t most) {
    std::vector<std::uint64_t> order;  // by cost, whose bits order it, then by the first node
    order.reserve(pairs);
    for (std::size_t l = 0; l < count_; ++l) {
      const std::uint32_t i = live_[l];
      if (mate_[i] != kNoNode && i < mate_[i])
        order.push_back(std::uint64_t{std::bit_cast<std::uint32_t>(cost_[i])} << 32U | i);
    }
    const auto end = order.begin() + static_cast<std::ptrdiff_t>(most);
    std::nth_element(order.begin(), end, order.end());
    std::for_each(end, order.end(), [&](std::uint64_t dropped) {
      const auto i = static_cast<std::uint32_t>(dropped);
      mate_[mate_[i]] = kNoNode;
      mate_[i] = kNoNode;
    });
  }

  // Contracts the pairs and takes their second nodes from the list of those that are left.
  void contract() {
    struct Offset {
      std::size_t node = 0, pair = 0;
      Offset operator+(const Offset& other) const { return {node + other.node, pair + other.pair}; }
    };
    std::vector<Offset> offset((count_ + kBlock - 1) / kBlock + 1);
    parallel_for(
        count_,
        [&](std::size_t begin, std::size_t end) {
          Offset& here = offset[begin / kBlock + 1];
          for (std::size_t l = begin; l < end; ++l) {
            const std::uint32_t i = live_[l];
            here.node += mate_[i] > i ? 1 : 0;  // kNoNode is
            here.pair += mate_[i] > i && mate_[i] != kNoNode ? 1 : 0;
          }
        },
        kBlock);
    std::partial_sum(offset.begin(), offset.end(), offset.begin());
    parallel_for(
        count_,
        [&](std::size_t begin, std::size_t end) {
          auto [next, pair] = offset[begin / kBlock];
          contract_block(begin, end, log_.count + pair);
          for (std::size_t l = begin; l < end; ++l) {
            const std::uint32_t i = live_[l];
            if (mate_[i] > i) next_live_[next++] = i;
          }
        },
        kBlock);
    log_.count += offset.back().pair;
    count_ = offset.back().node;
    live_.swap(next_live_);
    pad_live();
  }

  // The pairs whose first nodes are live_[begin] .. live_[end - 1], as the steps from `step` on.
  void contract_block(std::size_t begin, std::size_t end, std::size_t step) {
    std::uint32_t first[kBlock] = {};
    std::uint32_t second[kBlock] = {};
    std::size_t pairs = 0;
    for (std::size_t l = begin; l < end; ++l) {
      const std::uint32_t i = live_[l];
      first[pairs] = i;
      second[pairs] = mate_[i];
      pairs += mate_[i] > i && mate_[i] != kNoNode ? 1 : 0;
    }
    std::fill(first + pairs, first + padded_to_block(pairs), first[0]);
    std::fill(second + pairs, second + padded_to_block(pairs), first[0]);
    const auto merged = std::make_unique_for_overwrite<ContractionNode[]>(padded_to_block(pairs));
    nodes_.contract(first, second, pairs, merged.get());
    for (std::size_t p = 0; p < pairs; ++p, ++step) {
      const std::uint32_t a = first[p];
      const std::uint32_t b = second[p];
      nodes_.set(a, merged[p]);
      forward_[b] = a;
      made_at_[a] = std::max({cost_[a], made_at_[a], made_at_[b]});
      step_[a] = static_cast<std::uint32_t>(step);
      write_step(log_.steps[step], id_[a], id_[b], made_at_[a], merged[p]);
    }
  }

  static void write_step(ContractionLog::Step& step, std::uint32_t survivor, std::uint32_t removed,
                         float cost, const ContractionNode& node) {
    const float* f = node.fields;
    step.contraction = {survivor, removed, std::sqrt(f[12])};
    step.cost = cost;
    std::copy(f, f + 3, step.position);
    std::copy(f + 13, f + 16, step.normal);
  }

  // Rows follow the last round's contractions, and so do the cheapest pairs.
  void update_rows() {
    const auto merge = POINTWRIGHT_KERNEL(merge_rows_kernel);
    parallel_for(
        count_,
        [&](std::size_t begin, std::size_t end) {
          std::uint8_t length[kBlock];
          merge({.nodes = nodes_.data(),
                 .forward = forward_.get(),
                 .live = live_.get(),
                 .mate = mate_.get(),
                 .rows = rows_[0].neighbor,
                 .length = length},
                begin, end);
          for (std::size_t l = begin; l < end; ++l) {
            const std::uint32_t i = live_[l];
            if (mate_[i] == kNoNode) continue;
            ContractionLog::Step& step = log_.steps[step_[i]];
            step.neighbor_count = length[l - begin];
            step.first_neighbor = std::uint64_t{step_[i]} * kRowNeighbors;
            for (std::uint32_t s = 0; s < step.neighbor_count; ++s) {
              log_.neighbors[step.first_neighbor + s] = id_[rows_[i].neighbor[s]];
            }
          }
          rate_changed(begin, end);
        },
        kBlock, context_);
  }

  // Pairs grow no cheaper: that of a node stays its cheapest where neither of the two has changed. (With a
  // length term a changed one may have come nearer; it knows that itself and offers.)
  void rate_changed(std::size_t begin, std::size_t end) {
    std::uint32_t changed[kBlock];
    std::size_t count = 0;
    for (std::size_t l = begin; l < end; ++l) {
      const std::uint32_t i = live_[l];
      const std::uint32_t j = partner_[i];
      changed[count] = i;
      count += mate_[i] != kNoNode || j == kNoNode || mate_[j] != kNoNode ? 1 : 0;
    }
    std::fill(changed + count, changed + padded_to_block(count), changed[0]);
    rate(changed, count);
  }

  // Numbers the nodes that are left anew, so that what a round reads is dense in memory again.
  void compact() {
    parallel_for(count_, [&](std::size_t begin, std::size_t end) {
      for (std::size_t l = begin; l < end; ++l) forward_[live_[l]] = static_cast<std::uint32_t>(l);
    });
    nodes_.compact(live_.get(), count_);
    pointwright::compact(id_, live_.get(), count_);
    pointwright::compact(made_at_, live_.get(), count_);
    pointwright::compact(cost_, live_.get(), count_);
    pointwright::compact(key_, live_.get(), count_);
    pointwright::compact(partner_, live_.get(), count_);
    pointwright::compact(rows_, live_.get(), count_);
    parallel_for(count_, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        for (std::uint32_t& neighbor : rows_[i].neighbor) neighbor = forward_[neighbor];
        if (partner_[i] != kNoNode) partner_[i] = forward_[partner_[i]];
      }
    });
    for (auto* column : {&mate_, &step_}) *column = make_large_array<std::uint32_t>(count_);
    set_room(count_);
  }

  const ContractionGoal& goal_;
  ContractionNodes& nodes_;
  ContractionLog& log_;
  const ExecutionContext* context_;
  std::size_t room_ = 0;                 // nodes, the contracted ones among them
  std::size_t count_ = 0;                // and those that are left,
  LargeArray<std::uint32_t> live_;       // which are these, ascending
  LargeArray<std::uint32_t> next_live_;  // where the next round's are written
  LargeArray<std::uint32_t> forward_;    // of every node, what it is part of
  LargeArray<std::uint32_t> id_;         // indices into the input, ascending
  LargeArray<float> made_at_;            // the cost of the contraction that made each, in the log's sense
  LargeArray<ContractionRow> rows_;
  LargeArray<float> cost_;             // of each one's cheapest pair
  LargeArray<std::uint32_t> key_;      // PartnerKernelArgs::key
  LargeArray<std::uint32_t> partner_;  // the other node of that pair
  LargeArray<std::uint32_t> mate_;     // what each is contracted with in this round, or kNoNode
  LargeArray<std::uint32_t> step_;     // of a contracted one, the number in the log
};

}  // namespace

bool contract_in_batches(const Points& position, const NeighborGraph& graph, const ContractionGoal& goal,
                         ContractionNodes& nodes, ContractionLog& log, const ExecutionContext* context) {
  return Batches(goal, nodes, log, context).run(position, graph);
}

}  // namespace pointwright

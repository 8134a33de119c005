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

// The samples that are left are numbered anew in each round, so that what a round reads is dense in memory.
class Batches {
 public:
  Batches(const ContractionGoal& goal, ContractionNodes& nodes, ContractionLog& log,
          const ExecutionContext* context)
      : goal_(goal),
        nodes_(nodes),
        log_(log),
        context_(context),
        count_(nodes.count()),
        cost_(make_large_array<float>(padded_to_block(count_))) {
    for (auto* column : {&key_, &partner_, &mate_, &map_, &source_, &second_, &step_}) {
      *column = make_large_array<std::uint32_t>(padded_to_block(count_));
    }
    std::uint32_t* const id = id_.next(count_);
    float* const made_at = made_at_.next(count_);
    std::iota(id, id + count_, 0U);
    std::fill_n(made_at, count_, 0.0F);
    id_.swap();
    made_at_.swap();
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
      } else {
        if (is_new_graph || count_ <= goal_.count) break;
        is_new_graph = true;
        const SurvivorGraph left = survivor_graph(nodes_, context_);
        if (is_cancelled()) return false;
        start_rows(left.position, left.graph);
      }
    }
    return !is_cancelled();
  }

 private:
  [[nodiscard]] bool is_cancelled() const { return context_ != nullptr && context_->is_cancelled(); }

  // Rows from a graph over the samples that are left.
  void start_rows(const Points& position, const NeighborGraph& graph) {
    ContractionRow* const rows = rows_.next(count_);
    parallel_for(
        count_,
        [&](std::size_t begin, std::size_t end) {
          for (std::size_t i = begin; i < end; ++i) {
            const std::uint32_t length = starting_row(position, graph, i, rows[i].neighbor);
            std::fill(rows[i].neighbor + length, rows[i].neighbor + kRowNeighbors,
                      static_cast<std::uint32_t>(i));
          }
          rate(rows, begin, end);
        },
        kBlock, context_);
    rows_.swap();
  }

  // Finds the cheapest pairs of the nodes [begin, end) over their own rows.
  void rate(ContractionRow* rows, std::size_t begin, std::size_t end) {
    const std::size_t padded = padded_to_block(end);
    std::fill(rows + end, rows + padded, ContractionRow{});
    POINTWRIGHT_KERNEL(best_partners_kernel)
    ({.nodes = nodes_.data(),
      .rows = rows->neighbor,
      .rule = goal_.rule,
      .cost = cost_.get(),
      .key = key_.get(),
      .partner = partner_.get()},
     begin, padded);
  }

  // Marks the pairs that are the cheapest of both their samples in mate_, the cheapest `most` of them. Returns
  // whether there is any.
  bool find_pairs(std::size_t most) {
    accept_offers();
    const auto mark = [&](std::size_t begin, std::size_t end) {
      std::size_t found = 0;
      for (std::size_t i = begin; i < end; ++i) {
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

  // Rows need not be symmetric: a node that is listed by one that it does not list itself learns so here where
  // that makes its cheapest pair.
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
          for (std::size_t i = begin; i < end; ++i) {
            const std::uint32_t j = partner_[i];
            if (j == kNoNode || partner_[j] == i) continue;
            const Offer offer{cost_[i], key_[i], static_cast<std::uint32_t>(i), j};
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
    for (std::uint32_t i = 0; i < count_; ++i) {
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

  // Contracts the pairs and numbers the nodes anew: a contracted one has its first node's place in the order.
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
          for (std::size_t i = begin; i < end; ++i) {
            here.node += mate_[i] == kNoNode || i < mate_[i] ? 1 : 0;
            here.pair += mate_[i] != kNoNode && i < mate_[i] ? 1 : 0;
          }
        },
        kBlock);
    std::partial_sum(offset.begin(), offset.end(), offset.begin());
    const std::size_t left = offset.back().node;
    ContractionNode* const nodes = nodes_.next(left);
    std::uint32_t* const id = id_.next(left);
    float* const made_at = made_at_.next(left);
    parallel_for(
        count_,
        [&](std::size_t begin, std::size_t end) {
          const auto merged = contracted(begin, end);
          auto [next, pair] = offset[begin / kBlock];
          const std::size_t first_pair = pair;
          for (std::size_t i = begin; i < end; ++i) {
            const std::uint32_t other = mate_[i];
            if (other < i) continue;
            const auto node = static_cast<std::uint32_t>(next);
            map_[i] = node;
            source_[next] = static_cast<std::uint32_t>(i);
            second_[next] = other;
            id[next] = id_.data()[i];
            if (other == kNoNode) {
              nodes[next] = nodes_[i];
              made_at[next] = made_at_.data()[i];
            } else {
              map_[other] = node;
              nodes[next] = merged[pair - first_pair];
              made_at[next] = std::max({cost_[i], made_at_.data()[i], made_at_.data()[other]});
              const std::size_t step = log_.count + pair++;
              step_[next] = static_cast<std::uint32_t>(step);
              write_step(log_.steps[step], id_.data()[i], id_.data()[other], made_at[next], nodes[next]);
            }
            ++next;
          }
        },
        kBlock);
    log_.count += offset.back().pair;
    nodes_.replace(left);
    id_.swap();
    made_at_.swap();
    count_ = left;
  }

  // The results of the pairs whose first nodes are [begin, end), in this order.
  [[nodiscard]] std::unique_ptr<ContractionNode[]> contracted(std::size_t begin, std::size_t end) const {
    std::uint32_t first[kBlock] = {};
    std::uint32_t second[kBlock] = {};
    std::size_t pairs = 0;
    for (std::size_t i = begin; i < end; ++i) {
      if (mate_[i] == kNoNode || mate_[i] < i) continue;
      first[pairs] = static_cast<std::uint32_t>(i);
      second[pairs++] = mate_[i];
    }
    auto merged = std::make_unique_for_overwrite<ContractionNode[]>(padded_to_block(pairs));
    nodes_.contract(first, second, pairs, merged.get());
    return merged;
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
    ContractionRow* const rows = rows_.next(count_);
    const auto merge = POINTWRIGHT_KERNEL(merge_rows_kernel);
    parallel_for(
        count_,
        [&](std::size_t begin, std::size_t end) {
          std::uint8_t length[kBlock];
          merge({.rows = rows_.data()->neighbor,
                 .map = map_.get(),
                 .source = source_.get(),
                 .partner = second_.get(),
                 .nodes = nodes_.data(),
                 .new_rows = rows->neighbor,
                 .length = length},
                begin, end);
          for (std::size_t i = begin; i < end; ++i) {
            if (second_[i] == kNoNode) continue;
            ContractionLog::Step& step = log_.steps[step_[i]];
            step.neighbor_count = length[i - begin];
            step.first_neighbor = std::uint64_t{step_[i]} * kRowNeighbors;
            for (std::uint32_t s = 0; s < step.neighbor_count; ++s) {
              log_.neighbors[step.first_neighbor + s] = id_.data()[rows[i].neighbor[s]];
            }
          }
          rate(rows, begin, end);
        },
        kBlock, context_);
    rows_.swap();
  }

  const ContractionGoal& goal_;
  ContractionNodes& nodes_;
  ContractionLog& log_;
  const ExecutionContext* context_;
  std::size_t count_;                  // samples that are left
  ShrinkingColumn<std::uint32_t> id_;  // indices into the input, ascending
  ShrinkingColumn<float> made_at_;     // the cost of the contraction that made each, in the log's sense
  ShrinkingColumn<ContractionRow> rows_;
  LargeArray<float> cost_;             // of each one's cheapest pair
  LargeArray<std::uint32_t> key_;      // PartnerKernelArgs::key
  LargeArray<std::uint32_t> partner_;  // the other node of that pair
  LargeArray<std::uint32_t> mate_;     // what each is contracted with in this round, or kNoNode
  LargeArray<std::uint32_t> map_;      // old number to new one
  LargeArray<std::uint32_t> source_;   // new number to the old one, of contracted pairs the first,
  LargeArray<std::uint32_t> second_;   // the second, or kNoNode,
  LargeArray<std::uint32_t> step_;     // and the number in the log
};

}  // namespace

bool contract_in_batches(const Points& position, const NeighborGraph& graph, const ContractionGoal& goal,
                         ContractionNodes& nodes, ContractionLog& log, const ExecutionContext* context) {
  return Batches(goal, nodes, log, context).run(position, graph);
}

}  // namespace pointwright

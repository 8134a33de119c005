// Contraction in rounds of independent pairs. Quadrics only grow, so a pair that is the cheapest of both its
// samples stays so whatever is contracted elsewhere: Q_a + Q_b + Q_x is nowhere less than Q_a + Q_x. All such
// pairs may therefore go at once, as reciprocal nearest neighbours do in hierarchical clustering, and give
// the same tree of contractions as the greedy order; the order of costs then says where the tree is cut.
#include <algorithm>
#include <atomic>
#include <bit>
#include <cmath>
#include <cstring>
#include <numeric>

#include "engine/core/parallel.h"
#include "engine/simplification/contraction.h"

namespace pointwright {
namespace {

constexpr std::uint32_t kNone = 0xffffffffU;
constexpr std::uint32_t kNoCost = 0x7f800000U;  // the bits of infinity
constexpr std::size_t kBlock = 1024;            // nodes of a parallel block
constexpr std::size_t kBatch = 64;              // nodes whose pairs are rated together
// Rounds contract this much beyond the goal, of the samples to be left; the cheapest contractions of all
// count. What is dear in an early round can be cheap beside what comes later.
constexpr double kSurplus = 0.5;

std::uint32_t bits_of(float cost) {
  return std::bit_cast<std::uint32_t>(cost);
}

// The least of all offers, whatever their order.
template <typename T>
void lower(T& value, T offer) {
  const std::atomic_ref<T> ref(value);
  T current = ref.load(std::memory_order_relaxed);
  while (offer < current && !ref.compare_exchange_weak(current, offer, std::memory_order_relaxed)) {
  }
}

bool contains(const ContractionRow& row, std::uint32_t length, std::uint32_t i) {
  bool is_found = false;
  for (std::uint32_t s = 0; s < kRowNeighbors; ++s) is_found |= (row.neighbor[s] == i) & (s < length);
  return is_found;
}

// Rows while they are brought up to date: of every node up to two old ones, one after the other.
struct Draft {
  // A row is written as a whole, wherever it ends.
  static constexpr std::size_t kRoom = (kBatch * 2 + 1) * kRowNeighbors;
  std::uint32_t neighbor[kRoom];
  float cost[kRoom];
  std::uint32_t row_end[kBatch];
  std::uint32_t size;
  // Pairs whose costs are to be computed, and where those go.
  std::uint32_t first[kRoom];
  std::uint32_t second[kRoom];
  std::uint32_t target[kRoom];
  float fresh_cost[kRoom];
  std::size_t pair_count;
};

// The samples that are left are numbered anew after each round, so that what a round reads is dense in
// memory.
class Batches {
 public:
  Batches(const ContractionGoal& goal, ContractionNodes& nodes, ContractionLog& log,
          const ExecutionContext* context)
      : goal_(goal),
        nodes_(nodes),
        log_(log),
        context_(context),
        id_(nodes.count()),
        step_(nodes.count(), kNone) {
    std::iota(id_.begin(), id_.end(), 0U);
    row_ = std::make_unique_for_overwrite<ContractionRow[]>(id_.size());
  }

  bool run(const Points& position, const NeighborGraph& graph) {
    const bool is_bounded = goal_.limit < std::numeric_limits<float>::infinity();
    const auto surplus =
        static_cast<std::size_t>(is_bounded ? 0.0 : kSurplus * static_cast<double>(goal_.count));
    const std::size_t least = std::max<std::size_t>(goal_.count - surplus, 1);
    if (!is_bounded) reserve_log(id_.size() - least);
    start_rows(position, graph);
    bool is_new_graph = false;
    while (id_.size() > least) {
      if (is_cancelled()) return false;
      std::vector<ContractionPair> pairs = find_pairs();
      if (is_cancelled()) return false;
      if (pairs.empty()) {
        if (is_new_graph || id_.size() <= goal_.count) break;
        is_new_graph = true;
        const SurvivorGraph left = survivor_graph(nodes_, context_);
        if (is_cancelled()) return false;
        start_rows(left.position, left.graph);
        continue;
      }
      is_new_graph = false;
      keep_cheapest(pairs, id_.size() - least);
      contract(pairs);
      renumber();
    }
    return !is_cancelled();
  }

 private:
  [[nodiscard]] bool is_cancelled() const { return context_ != nullptr && context_->is_cancelled(); }

  void reserve_log(std::size_t steps) {
    log_.steps.reserve(steps);
    log_.cost.reserve(steps);
    log_.state.reserve(steps);
    log_.row.reserve(steps);
  }

  void reset_offers() {
    best_.resize(id_.size());
    own_.resize(id_.size());
    tie_.resize(id_.size());
    partner_.resize(id_.size());
    parallel_for(id_.size(), [&](std::size_t begin, std::size_t end) {
      const auto fill = [&](auto& column, auto value) {
        std::fill(column.data() + begin, column.data() + end, value);
      };
      fill(best_, kNoCost);
      fill(tie_, ~std::uint64_t{0});
      fill(partner_, kNone);
    });
  }

  // Rows from a graph over the samples that are left. Of a pair that both its samples list, one forgets it:
  // every pair is rated once.
  void start_rows(const Points& position, const NeighborGraph& graph) {
    length_.resize(id_.size());
    parallel_for(id_.size(), [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        length_[i] = static_cast<std::uint8_t>(starting_row(position, graph, i, row_[i].neighbor));
      }
    });
    std::vector<std::uint16_t> forgotten(id_.size(), 0);
    static_assert(kRowNeighbors <= 16);
    parallel_for(id_.size(), [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        std::uint32_t mask = 0;
        for (std::uint32_t s = 0; s < length_[i]; ++s) {
          const std::uint32_t other = row_[i].neighbor[s];
          const bool is_ours = ((i ^ other) & 1U) == static_cast<std::uint32_t>(i < other);
          if (!is_ours && contains(row_[other], length_[other], static_cast<std::uint32_t>(i)))
            mask |= 1U << s;
        }
        forgotten[i] = static_cast<std::uint16_t>(mask);
      }
    });
    reset_offers();
    parallel_for(
        id_.size(),
        [&](std::size_t begin, std::size_t end) {
          const auto draft = std::make_unique_for_overwrite<Draft>();
          for (std::size_t batch = begin; batch < end; batch += kBatch) {
            const std::size_t batch_end = std::min(batch + kBatch, end);
            draft->pair_count = draft->size = 0;
            for (std::size_t i = batch; i < batch_end; ++i) {
              for (std::uint32_t s = 0; s < length_[i]; ++s) {
                if ((forgotten[i] >> s & 1U) == 0) add_pair(i, row_[i].neighbor[s], *draft);
              }
              draft->row_end[i - batch] = draft->size;
            }
            rate(*draft);
            put_rows(batch, batch_end, row_.get(), length_, *draft);
          }
        },
        kBlock, context_);
  }

  static void add_pair(std::size_t i, std::uint32_t other, Draft& draft) {
    const auto own = static_cast<std::uint32_t>(i);
    draft.first[draft.pair_count] = std::min(own, other);
    draft.second[draft.pair_count] = std::max(own, other);
    draft.target[draft.pair_count++] = draft.size;
    draft.neighbor[draft.size++] = other;
  }

  void rate(Draft& draft) const {
    std::fill(draft.first + draft.pair_count, draft.first + padded_to_block(draft.pair_count), 0U);
    std::fill(draft.second + draft.pair_count, draft.second + padded_to_block(draft.pair_count), 0U);
    nodes_.costs(goal_, draft.first, draft.second, draft.pair_count, draft.fresh_cost);
    for (std::size_t p = 0; p < draft.pair_count; ++p) draft.cost[draft.target[p]] = draft.fresh_cost[p];
  }

  // Writes the rows of the nodes [begin, end); each learns its cheapest pair, and so do those that it lists.
  void put_rows(std::size_t begin, std::size_t end, ContractionRow* rows, std::vector<std::uint8_t>& lengths,
                const Draft& draft) {
    std::size_t row_begin = 0;
    for (std::size_t i = begin; i < end; ++i) {
      const std::size_t row_end = draft.row_end[i - begin];
      ContractionRow& row = rows[i];
      const std::size_t length = std::min<std::size_t>(row_end - row_begin, kRowNeighbors);
      lengths[i] = static_cast<std::uint8_t>(length);
      if (row_end - row_begin <= kRowNeighbors) {
        std::memcpy(row.neighbor, draft.neighbor + row_begin, sizeof row.neighbor);
        std::memcpy(row.cost, draft.cost + row_begin, sizeof row.cost);
      } else {
        copy_cheapest(draft, row_begin, row_end, row);
      }
      row_begin = row_end;
      std::uint32_t own = kNoCost;
      for (std::size_t s = 0; s < length; ++s) {
        const std::uint32_t cost = bits_of(row.cost[s]);
        own = std::min(own, cost);
        lower(best_[row.neighbor[s]], cost);
      }
      own_[i] = own;
      lower(best_[i], own);
    }
  }

  static void copy_cheapest(const Draft& draft, std::size_t begin, std::size_t end, ContractionRow& row) {
    std::pair<float, std::uint32_t> sorted[2 * kRowNeighbors];
    for (std::size_t e = begin; e < end; ++e) sorted[e - begin] = {draft.cost[e], draft.neighbor[e]};
    std::sort(sorted, sorted + (end - begin));
    for (std::uint32_t s = 0; s < kRowNeighbors; ++s) {
      row.cost[s] = sorted[s].first;
      row.neighbor[s] = sorted[s].second;
    }
  }

  // The pairs that are the cheapest of both their samples, ascending by their first.
  std::vector<ContractionPair> find_pairs() {
    std::vector<std::vector<ContractionPair>> found((id_.size() + kBlock - 1) / kBlock);
    parallel_for(
        id_.size(),
        [&](std::size_t begin, std::size_t end) {
          std::vector<ContractionPair>& part = found[begin / kBlock];
          for (std::size_t l = begin; l < end; ++l) {
            const auto i = static_cast<std::uint32_t>(l);
            if (own_[i] != best_[i] || own_[i] == kNoCost) continue;
            const ContractionRow& row = row_[i];
            for (std::uint32_t s = 0; s < length_[i]; ++s) {
              const std::uint32_t other = row.neighbor[s];
              if (bits_of(row.cost[s]) != best_[i] || best_[i] != best_[other]) continue;
              const ContractionPair pair{std::min(i, other), std::max(i, other), row.cost[s]};
              if (i == pair.second && contains(row_[other], length_[other], i)) continue;  // found there, too
              part.push_back(pair);
              lower(tie_[i], key_of(pair));
              lower(tie_[other], key_of(pair));
            }
          }
        },
        kBlock, context_);
    parallel_for(
        found.size(),
        [&](std::size_t begin, std::size_t end) {
          for (std::size_t b = begin; b < end; ++b) {
            std::erase_if(found[b], [&](const ContractionPair& pair) {
              return tie_[pair.first] != key_of(pair) || tie_[pair.second] != key_of(pair);
            });
          }
        },
        1);
    std::vector<ContractionPair> pairs;
    for (const auto& part : found) pairs.insert(pairs.end(), part.begin(), part.end());
    return pairs;
  }

  [[nodiscard]] std::uint64_t key_of(const ContractionPair& pair) const {
    return tie_key(id_[pair.first], id_[pair.second]);
  }

  static void keep_cheapest(std::vector<ContractionPair>& pairs, std::size_t most) {
    if (pairs.size() <= most) return;
    const auto cheaper = [](const ContractionPair& a, const ContractionPair& b) {
      return a.cost != b.cost ? a.cost < b.cost : a.first < b.first;
    };
    std::nth_element(pairs.begin(), pairs.begin() + static_cast<std::ptrdiff_t>(most), pairs.end(), cheaper);
    pairs.resize(most);
    std::sort(pairs.begin(), pairs.end(), cheaper);
  }

  void contract(const std::vector<ContractionPair>& pairs) {
    const std::size_t before = log_.steps.size();
    const std::size_t after = before + pairs.size();
    log_.steps.resize(after);
    log_.cost.resize(after);
    log_.state.resize(after);
    log_.row.resize(after);
    const auto cost_of = [&](std::uint32_t node) {
      return step_[node] == kNone ? 0.0F : log_.cost[step_[node]];
    };
    parallel_for(
        pairs.size(),
        [&](std::size_t begin, std::size_t end) {
          std::vector<ContractionNode> merged;
          nodes_.contract(std::span(pairs).subspan(begin, end - begin), merged);
          for (std::size_t p = begin; p < end; ++p) {
            const auto [first, second, cost] = pairs[p];
            const float* f = merged[p - begin].fields;
            const std::size_t step = before + p;
            log_.steps[step] = {id_[first], id_[second], std::sqrt(f[12])};
            log_.cost[step] = std::max({cost, cost_of(first), cost_of(second)});
            log_.state[step] = {{f[0], f[1], f[2]}, {f[13], f[14], f[15]}};
            nodes_.set(first, merged[p - begin]);
            step_[first] = static_cast<std::uint32_t>(step);
            partner_[first] = second;
            partner_[second] = first;
          }
        },
        kBlock);
  }

  // What a contracted pair is from now on bears its first sample's place in the order; rows follow.
  void renumber() {
    const std::size_t old_count = id_.size();
    const std::size_t blocks = (old_count + kBlock - 1) / kBlock;
    const auto is_left = [&](std::size_t i) { return partner_[i] == kNone || partner_[i] > i; };
    std::vector<std::size_t> offset(blocks + 1, 0);
    parallel_for(
        old_count,
        [&](std::size_t begin, std::size_t end) {
          for (std::size_t i = begin; i < end; ++i) offset[begin / kBlock + 1] += is_left(i) ? 1 : 0;
        },
        kBlock);
    std::partial_sum(offset.begin(), offset.end(), offset.begin());
    map_.resize(old_count);
    source_.resize(offset.back());
    std::vector<std::uint32_t> id(source_.size());
    std::vector<std::uint32_t> step(source_.size());
    parallel_for(
        old_count,
        [&](std::size_t begin, std::size_t end) {
          std::size_t next = offset[begin / kBlock];
          for (std::size_t i = begin; i < end; ++i) {
            if (!is_left(i)) continue;
            map_[i] = static_cast<std::uint32_t>(next) | (partner_[i] == kNone ? 0U : kChanged);
            source_[next] = static_cast<std::uint32_t>(i);
            id[next] = id_[i];
            step[next++] = step_[i];
          }
        },
        kBlock);
    parallel_for(old_count, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        if (!is_left(i)) map_[i] = map_[partner_[i]];
      }
    });
    id_.swap(id);
    step_.swap(step);
    nodes_.compact(source_);
    old_partner_.swap(partner_);
    reset_offers();
    update_rows();
  }

  // Rows follow the last round's contractions; only costs of pairs with a changed sample are computed anew.
  void update_rows() {
    const std::size_t chunk_base = log_.chunks.size();
    log_.chunks.resize(chunk_base + (id_.size() + kBlock - 1) / kBlock);
    if (!spare_row_) spare_row_ = std::make_unique_for_overwrite<ContractionRow[]>(id_.size());
    spare_length_.resize(id_.size());
    const auto merge = POINTWRIGHT_KERNEL(merge_rows_kernel);
    const auto args_for = [&](Draft& draft) {
      return RowKernelArgs{.rows = row_.get(),
                           .length = length_.data(),
                           .map = map_.data(),
                           .source = source_.data(),
                           .partner = old_partner_.data(),
                           .neighbor = draft.neighbor,
                           .cost = draft.cost,
                           .row_end = draft.row_end,
                           .first = draft.first,
                           .second = draft.second,
                           .target = draft.target};
    };
    parallel_for(
        id_.size(),
        [&](std::size_t begin, std::size_t end) {
          const auto draft = std::make_unique_for_overwrite<Draft>();
          const std::size_t chunk = chunk_base + begin / kBlock;
          std::vector<std::uint32_t>& list = log_.chunks[chunk];
          list.reserve((end - begin) * kRowNeighbors / 4);
          for (std::size_t batch = begin; batch < end; batch += kBatch) {
            const std::size_t batch_end = std::min(batch + kBatch, end);
            draft->pair_count = merge(args_for(*draft), batch, batch_end);
            rate(*draft);
            put_rows(batch, batch_end, spare_row_.get(), spare_length_, *draft);
            for (std::size_t i = batch; i < batch_end; ++i) {
              if (old_partner_[source_[i]] == kNone) continue;
              log_.row[step_[i]] = {static_cast<std::uint32_t>(chunk),
                                    static_cast<std::uint32_t>(list.size()), spare_length_[i]};
              for (std::uint32_t s = 0; s < spare_length_[i]; ++s)
                list.push_back(id_[spare_row_[i].neighbor[s]]);
            }
          }
        },
        kBlock, context_);
    row_.swap(spare_row_);
    length_.swap(spare_length_);
  }

  const ContractionGoal& goal_;
  ContractionNodes& nodes_;
  ContractionLog& log_;
  const ExecutionContext* context_;
  std::vector<std::uint32_t> id_;    // of the samples that are left, ascending: indices into the input
  std::vector<std::uint32_t> step_;  // the contraction that made each, or kNone
  std::unique_ptr<ContractionRow[]> row_, spare_row_;
  std::vector<std::uint8_t> length_, spare_length_;
  std::vector<std::uint32_t> best_;  // the bits of the cost of each one's cheapest pair
  std::vector<std::uint32_t> own_;   // the same over its own row alone
  std::vector<std::uint64_t> tie_;   // the least key of its pairs of that cost
  std::vector<std::uint32_t> partner_,
      old_partner_;                    // in this round's contractions and in the last one's, or kNone
  std::vector<std::uint32_t> map_;     // old number to new one, with kChanged
  std::vector<std::uint32_t> source_;  // new number to old one
};

}  // namespace

bool contract_in_batches(const Points& position, const NeighborGraph& graph, const ContractionGoal& goal,
                         ContractionNodes& nodes, ContractionLog& log, const ExecutionContext* context) {
  return Batches(goal, nodes, log, context).run(position, graph);
}

}  // namespace pointwright

// J. B. Kruskal, "On the shortest spanning subtree of a graph", 1956, over regions of the samples at once.
#include "engine/normals/spanning_forest.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <limits>
#include <memory>
#include <numeric>
#include <span>

#include "engine/core/parallel.h"
#include "engine/normals/spanning_kernels.h"

namespace pointwright {
namespace {

constexpr std::size_t kCancelInterval = std::size_t{1} << 16;
constexpr std::size_t kWeightLevels = 2048;
constexpr std::size_t kCacheLine = 64;
constexpr std::uint16_t kUntouched = std::numeric_limits<std::uint16_t>::max();

// An edge with its weight and side as the kernel packs them.
struct Edge {
  std::uint32_t a = 0;
  std::uint32_t b = 0;
  std::uint32_t packed = 0;

  [[nodiscard]] std::uint32_t weight() const { return packed >> 1; }
  [[nodiscard]] bool opposed() const { return (packed & 1U) != 0; }
};

// What edge_weights_kernel computes, for one edge.
std::uint32_t pack_edge(const Points& points, const Points& normals, std::size_t a, std::size_t b) {
  const auto dot = [](const Vec3f& u, const Vec3f& v) {
    return u.x() * v.x() + u.y() * v.y() + u.z() * v.z();
  };
  const Vec3f e = points[b] - points[a];
  const float along = dot(e, normals[a]) * dot(e, normals[b]);
  const float agreement = dot(normals[a], normals[b]) - 2.0F * along / std::max(dot(e, e), 1e-30F);
  const float weight =
      std::sqrt(std::clamp(1.0F - std::abs(agreement), 0.0F, 1.0F)) * static_cast<float>(kWeightLevels - 1);
  return (static_cast<std::uint32_t>(weight) << 1) | (agreement < 0.0F ? 1U : 0U);
}

// Disjoint sets that remember, per element, whether its side is opposed to that of its set's root, which is
// the lowest element.
class SidedSets {
 public:
  SidedSets(std::span<std::uint32_t> parent, std::span<std::uint8_t> opposed)
      : parent_(parent), opposed_(opposed) {}

  struct Root {
    std::uint32_t index;
    std::uint8_t opposed;
  };
  Root find(std::uint32_t i) {
    std::uint32_t root = i;
    std::uint8_t side = 0;
    while (parent_[root] != root) {
      side ^= opposed_[root];
      root = parent_[root];
    }
    const Root result{root, side};
    while (parent_[i] != root && i != root) {  // compress
      const std::uint32_t next = parent_[i];
      const std::uint8_t here = opposed_[i];
      parent_[i] = root;
      opposed_[i] = side;
      side ^= here;
      i = next;
    }
    return result;
  }
  // Joins two different roots; returns the one that stays.
  std::uint32_t join(const Root& a, const Root& b, bool opposed) {
    const auto [low, high] = std::minmax(a.index, b.index);
    parent_[high] = low;
    opposed_[high] = static_cast<std::uint8_t>(a.opposed ^ b.opposed ^ (opposed ? 1U : 0U));
    return low;
  }

 private:
  std::span<std::uint32_t> parent_;
  std::span<std::uint8_t> opposed_;
};

// The trees that the edges of a region make when they come by weight. A tree's elements carry its label, and
// the smaller one's are relabelled when two are joined: nearly all edges find equal labels, with two loads.
//
// Whether an edge is certain to be in the forest of the whole graph: when one of the two trees has no edge
// out of the region that is as light (the cut property). A tree that is held together by uncertain edges has
// such an edge in each of its parts, for both ends of an uncertain edge had; so the lightest edge out of the
// whole tree tells of its parts.
class LabelledTrees {
 public:
  // lightest_out: the least weight of the edges that leave the region at each element.
  LabelledTrees(std::uint32_t count, std::span<const std::uint16_t> lightest_out)
      : label_(count),
        next_(count),
        size_(count, 1),
        lightest_out_(lightest_out.begin(), lightest_out.end()),
        left_(count) {
    std::iota(label_.begin(), label_.end(), std::uint16_t{0});
    std::iota(next_.begin(), next_.end(), std::uint16_t{0});
  }

  [[nodiscard]] bool same(std::uint32_t a, std::uint32_t b) const { return label_[a] == label_[b]; }
  // One tree is left.
  [[nodiscard]] bool is_whole() const { return left_ == 1; }
  // Joins the trees of two elements; returns whether the edge is certain.
  bool join(std::uint32_t a, std::uint32_t b, std::uint32_t weight) {
    std::uint16_t into = label_[a];
    std::uint16_t from = label_[b];
    const bool certain = lightest_out_[into] > weight || lightest_out_[from] > weight;
    if (size_[into] < size_[from]) std::swap(into, from);
    size_[into] = static_cast<std::uint16_t>(size_[into] + size_[from]);
    lightest_out_[into] = std::min(lightest_out_[into], lightest_out_[from]);
    std::uint16_t i = from;  // elements are rings: a label is one of its elements
    do {
      label_[i] = into;
      i = next_[i];
    } while (i != from);
    std::swap(next_[into], next_[from]);
    --left_;
    return certain;
  }

 private:
  std::vector<std::uint16_t> label_, next_, size_, lightest_out_;  // the last two: of labels
  std::uint32_t left_;
};

bool is_listed(const NeighborGraph& graph, std::size_t i, std::uint32_t neighbor) {
  for (std::uint32_t j = 0; j < graph.k; ++j) {
    if (graph.index(i, j) == neighbor) return true;
  }
  return false;
}

// Packed edges of a region.
struct EdgeList {
  std::unique_ptr<std::uint64_t[]> edges;
  std::size_t count = 0;
};

class ForestBuilder {
 public:
  ForestBuilder(const Points& points, const NeighborGraph& graph, const Points& normals,
                const ExecutionContext* context)
      : points_(points),
        graph_(graph),
        normals_(normals),
        context_(context),
        touch_(points.size(), kUntouched),
        pending_((points.size() + kSpanRegion - 1) / kSpanRegion) {
    forest_.root.resize(points.size());
    forest_.opposed.resize(points.size());
  }

  SidedForest build() {
    const auto weigh = [&](std::size_t begin, std::size_t end) { weigh_edges_out(begin, end); };
    const auto span_one = [&](std::size_t begin, std::size_t end) { span_region(begin, end); };
    parallel_for(points_.size(), weigh, kSpanRegion, context_);
    if (is_cancelled()) return {};
    parallel_for(points_.size(), span_one, kSpanRegion, context_);
    if (is_cancelled() || !join_regions()) return {};
    return std::move(forest_);
  }

 private:
  [[nodiscard]] bool is_cancelled() const { return context_ != nullptr && context_->is_cancelled(); }

  // Collects the edges that leave a region, each once, and tells both their ends how light they are.
  void weigh_edges_out(std::size_t begin, std::size_t end) {
    std::vector<Edge>& out = pending_[begin / kSpanRegion];
    const auto add = [&](std::size_t a, std::size_t b) {
      const Edge edge{static_cast<std::uint32_t>(a), static_cast<std::uint32_t>(b),
                      pack_edge(points_, normals_, a, b)};
      out.push_back(edge);
      touch(edge.a, edge.weight());
      touch(edge.b, edge.weight());
    };
    if (begin > 0 && points_[begin] == points_[begin - 1]) add(begin - 1, begin);
    for (std::size_t block = begin / kSimdBlock; block * kSimdBlock < end; ++block) {
      for (std::uint32_t j = 0; j < graph_.k; ++j) {
        const std::uint32_t* row = graph_.row(block, j);
        const std::size_t lanes = std::min(kSimdBlock, end - block * kSimdBlock);
        for (std::size_t lane = 0; lane < lanes; ++lane) {
          const std::uint32_t b = row[lane];
          if (b - begin < end - begin) continue;  // unsigned: below begin is far above
          const std::size_t a = block * kSimdBlock + lane;
          if (a < b || !is_listed(graph_, b, static_cast<std::uint32_t>(a))) add(a, b);
        }
      }
    }
  }

  void touch(std::uint32_t sample, std::uint32_t weight) {
    const std::atomic_ref<std::uint16_t> lightest(touch_[sample]);
    std::uint16_t seen = lightest.load(std::memory_order_relaxed);
    while (weight < seen && !lightest.compare_exchange_weak(seen, static_cast<std::uint16_t>(weight),
                                                            std::memory_order_relaxed)) {
    }
  }

  // The edges inside a region, each once, by weight, then by the order of samples and neighbours, as
  // region_edges_kernel packs them.
  [[nodiscard]] EdgeList edges_inside(std::size_t begin, std::size_t end) const {
    const std::uint32_t k = graph_.k;
    const std::size_t n = end - begin;
    const auto packed = std::make_unique_for_overwrite<std::int32_t[]>(padded_to_block(n) * k);
    const EdgeWeightArgs weight_args{.x = points_.x(),
                                     .y = points_.y(),
                                     .z = points_.z(),
                                     .normal_x = normals_.x(),
                                     .normal_y = normals_.y(),
                                     .normal_z = normals_.z(),
                                     .neighbors = graph_.lanes.data(),
                                     .k = k};
    POINTWRIGHT_KERNEL(edge_weights_kernel)(weight_args, begin, padded_to_block(end), packed.get());

    const auto found = std::make_unique_for_overwrite<std::uint64_t[]>(n * (k + 1) + 1);
    std::size_t count = 0;
    for (std::uint64_t a = 1; a < n; ++a) {
      const std::size_t i = begin + a;
      if (points_[i] != points_[i - 1]) continue;
      const std::uint64_t edge = pack_edge(points_, normals_, i - 1, i);
      found[count++] = (edge >> 1 << 48) | ((a - 1) << 32) | (a << 16) | (edge & 1U);
    }
    // A list on two cache lines would be read twice.
    std::size_t space = n * padded_to_block(k) * sizeof(std::int32_t) + kCacheLine;
    const auto room = std::make_unique_for_overwrite<std::byte[]>(space);
    void* lists = room.get();
    std::align(kCacheLine, space - kCacheLine, lists, space);
    const RegionEdgesArgs edge_args{.neighbors = graph_.lanes.data(),
                                    .packed = packed.get(),
                                    .lists = static_cast<std::int32_t*>(lists),
                                    .k = k};
    count += POINTWRIGHT_KERNEL(region_edges_kernel)(edge_args, begin, end, found.get() + count);
    return sorted_by_weight(found.get(), count);
  }

  static EdgeList sorted_by_weight(const std::uint64_t* edges, std::size_t count) {
    EdgeList sorted{std::make_unique_for_overwrite<std::uint64_t[]>(count), count};
    std::array<std::uint32_t, kWeightLevels + 1> cursor{};
    for (std::size_t e = 0; e < count; ++e) ++cursor[(edges[e] >> 48) + 1U];
    std::partial_sum(cursor.begin(), cursor.end(), cursor.begin());
    for (std::size_t e = 0; e < count; ++e) sorted.edges[cursor[edges[e] >> 48]++] = edges[e];
    return sorted;
  }

  // Spans what the region can tell by itself; the edges that it cannot judge become pending.
  void span_region(std::size_t begin, std::size_t end) {
    const auto n = static_cast<std::uint32_t>(end - begin);
    LabelledTrees trees(n, {touch_.data() + begin, n});
    std::vector<std::uint32_t> parent(n);
    std::iota(parent.begin(), parent.end(), 0U);
    std::vector<std::uint8_t> opposed(n, 0);
    SidedSets sets(parent, opposed);
    std::vector<Edge>& pending = pending_[begin / kSpanRegion];
    const auto first = static_cast<std::uint32_t>(begin);
    const EdgeList list = edges_inside(begin, end);
    for (const std::uint64_t edge : std::span(list.edges.get(), list.count)) {
      const std::uint32_t from = static_cast<std::uint32_t>(edge >> 32) & 0xffffU;
      const std::uint32_t to = static_cast<std::uint32_t>(edge >> 16) & 0xffffU;
      // An edge that closes a cycle of lighter ones is in no minimum spanning forest.
      if (trees.same(from, to)) continue;
      if (trees.join(from, to, static_cast<std::uint32_t>(edge >> 48))) {
        sets.join(sets.find(from), sets.find(to), (edge & 1U) != 0);
      } else {
        const auto packed = static_cast<std::uint32_t>((edge >> 48 << 1) | (edge & 1U));
        pending.push_back({first + from, first + to, packed});
      }
      if (trees.is_whole()) break;
    }
    for (std::uint32_t i = 0; i < n; ++i) {
      const auto root = sets.find(i);
      forest_.root[begin + i] = first + root.index;
      forest_.opposed[begin + i] = root.opposed;
    }
  }

  // Kruskal's algorithm on the trees of the regions. False when cancelled.
  bool join_regions() {
    std::vector<std::uint64_t> keys;
    std::vector<Edge> edges;
    for (std::vector<Edge>& some : pending_) {
      edges.insert(edges.end(), some.begin(), some.end());
      some = {};
    }
    keys.reserve(edges.size());
    for (const Edge& edge : edges) keys.push_back(edge.weight());
    std::vector<std::uint32_t> order(edges.size());
    std::iota(order.begin(), order.end(), 0U);
    sort_by_key(keys, order);
    SidedSets sets(forest_.root, forest_.opposed);
    for (std::size_t e = 0; e < order.size(); ++e) {
      if (e % kCancelInterval == 0 && is_cancelled()) return false;
      const Edge& edge = edges[order[e]];
      const auto a = sets.find(edge.a);
      const auto b = sets.find(edge.b);
      if (a.index != b.index) sets.join(a, b, edge.opposed());
    }
    flatten();
    return !is_cancelled();
  }

  // Every sample points at its root.
  void flatten() {
    const std::vector<std::uint32_t> parent = forest_.root;
    const std::vector<std::uint8_t> side = forest_.opposed;
    parallel_for(parent.size(), [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        std::uint32_t root = parent[i];
        std::uint8_t opposed = side[i];
        while (parent[root] != root) {
          opposed ^= side[root];
          root = parent[root];
        }
        forest_.root[i] = root;
        forest_.opposed[i] = opposed;
      }
    });
  }

  const Points& points_;
  const NeighborGraph& graph_;
  const Points& normals_;
  const ExecutionContext* context_;
  SidedForest forest_;
  std::vector<std::uint16_t> touch_;        // per sample: the lightest edge that leaves its region
  std::vector<std::vector<Edge>> pending_;  // per region: what it cannot judge by itself
};

}  // namespace

SidedForest span_normals(const Points& points, const NeighborGraph& graph, const Points& normals,
                         const ExecutionContext* context) {
  return ForestBuilder(points, graph, normals, context).build();
}

}  // namespace pointwright

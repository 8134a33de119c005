#include "engine/resampling/collection.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <unordered_map>
#include <vector>

#include "engine/core/gather.h"
#include "engine/core/parallel.h"
#include "engine/resampling/cells.h"
#include "engine/spatial/kd_tree.h"

namespace pointwright {
namespace {

constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();
constexpr float kSqueezedArea = 0.7F;    // of the area at rest
constexpr std::uint32_t kNearest = 6;    // among them the nearest on the same side is looked for
constexpr std::size_t kMostRounds = 64;  // each halves the worst places; ten do for a squeeze by a thousand
constexpr float kMostGrowth = 4.0F;      // of a cell that takes another one over
constexpr std::size_t kMostVisited = 256;
constexpr std::size_t kCopies = 8;  // of a sample that a search may find before its neighbours

// Samples of an edited surface that may go, and those around them.
class Collection {
 public:
  Collection(const MultiresSurface& surface, const Sampling& sampling, const ScaleField& field, float closest)
      : surface_(surface),
        sampling_(sampling),
        closest_(closest),
        cells_{.u = sampling.cell_u, .v = sampling.cell_v},
        may_go_(sampling.size(), 0),
        gone_(sampling.size(), 0) {
    std::vector<std::uint8_t> near(sampling.size(), 0);
    for (std::size_t i = 0; i < sampling.size(); ++i) {
      if (!(field.t[i] > 0.0F) || !(sampling.spacing[i] > 0.0F) || !(area(i) < kSqueezedArea)) continue;
      may_go_[i] = 1;
      near[i] = 1;
      for (std::uint32_t j = 0; j < sampling.graph->k; ++j) near[sampling.graph->index(i, j)] = 1;
    }
    for (std::size_t i = 0; i < near.size(); ++i)
      if (near[i] != 0) members_.push_back(static_cast<std::uint32_t>(i));
  }

  // Removes one round of pairs, of inserted samples alone or of any. Returns whether there was one.
  bool round(bool inserted_alone) {
    inserted_alone_ = inserted_alone;
    std::erase_if(members_, [this](std::uint32_t i) { return gone_[i] != 0; });
    if (members_.size() < 2) return false;
    const std::vector<std::uint32_t> nearest = nearest_of_members();
    bool removed = false;
    for (std::size_t m = 0; m < members_.size(); ++m) {
      const std::uint32_t other = nearest[m];
      if (other == kNone || other < m || nearest[other] != m) continue;
      removed = remove_one(members_[m], members_[other]) || removed;
    }
    return removed;
  }

  [[nodiscard]] std::vector<std::uint32_t> survivors() const {
    std::vector<std::uint32_t> order;
    for (std::size_t i = 0; i < gone_.size(); ++i)
      if (gone_[i] == 0) order.push_back(static_cast<std::uint32_t>(i));
    return order;
  }
  [[nodiscard]] const std::vector<std::uint8_t>& gone() const { return gone_; }
  [[nodiscard]] const Cells& cells() const { return cells_; }

 private:
  [[nodiscard]] float area(std::size_t i) const { return cells_.u[i].cross(cells_.v[i]).norm(); }
  [[nodiscard]] Vec3f place(std::uint32_t i) const { return surface_.finest().position[i]; }

  // By member: its nearest member on the same side, as a number of a member.
  [[nodiscard]] std::vector<std::uint32_t> nearest_of_members() const {
    Points points(members_.size());
    for (std::size_t m = 0; m < members_.size(); ++m) points.set(m, place(members_[m]));
    const NeighborGraph graph = build_neighbor_graph(points, kNearest);
    std::vector<std::uint32_t> nearest(members_.size(), kNone);
    parallel_for(members_.size(), [&](std::size_t begin, std::size_t end) {
      for (std::size_t m = begin; m < end; ++m) nearest[m] = same_side(graph, points, m);
    });
    return nearest;
  }

  [[nodiscard]] std::uint32_t same_side(const NeighborGraph& graph, const Points& points,
                                        std::size_t m) const {
    const Points& normal = surface_.finest().normal;
    const auto faces = [&](std::size_t other) {
      if (inserted_alone_ && !inserted(members_[m]) && !inserted(members_[other])) return false;
      return normal[members_[m]].dot(normal[members_[other]]) > 0.0F;
    };
    // Graphs list no exact copies; where these stand one after the other they are the nearest of all.
    for (const std::size_t copy : {m + 1, m - 1}) {
      const bool there = copy < members_.size() && points[copy] == points[m];
      if (there && faces(copy) && (copy > m || m < 2 || points[m - 2] != points[m]))
        return static_cast<std::uint32_t>(copy);
    }
    for (std::uint32_t j = 0; j < graph.k; ++j)
      if (faces(graph.index(m, j))) return graph.index(m, j);
    return kNone;
  }

  bool remove_one(std::uint32_t a, std::uint32_t b) {
    if (!((place(b) - place(a)).norm() < closest_ * std::min(sampling_.spacing[a], sampling_.spacing[b])))
      return false;
    const bool a_may = may_go(a);
    const bool b_may = may_go(b);
    if (!a_may && !b_may) return false;
    const bool a_goes = !b_may || (a_may && goes_before(a, b));
    const std::uint32_t goes = a_goes ? a : b;
    gone_[goes] = 1;
    take_over(a_goes ? b : a, goes);
    return true;
  }

  [[nodiscard]] bool inserted(std::uint32_t i) const {
    return !sampling_.parent.empty() && sampling_.parent[i] != kNoParent;
  }
  [[nodiscard]] bool may_go(std::uint32_t i) const {
    if (may_go_[i] == 0) return false;
    // Who has taken over enough cells is squeezed no more: a pair that noise has brought together stays.
    return inserted_alone_ ? inserted(i) : area(i) < kSqueezedArea;
  }
  [[nodiscard]] bool goes_before(std::uint32_t a, std::uint32_t b) const {
    if (inserted(a) != inserted(b)) return inserted(a);
    return sampling_.cloud->id[a] > sampling_.cloud->id[b];
  }

  // The cell of who stays grows by that of who goes: across, up to a square, then every way. Squeezed pairs
  // lie along the shorter axis; cells longer than they must be would split again in the next edit.
  void take_over(std::uint32_t stays, std::uint32_t goes) {
    const Vec3f u = cells_.u[stays];
    const Vec3f v = cells_.v[stays];
    const PrincipalStretch own = principal_stretch(u, v);
    const float before = own.major * own.minor;
    if (!(before > 0.0F)) return;
    const float after = std::min(before + area(goes), kMostGrowth * before);
    const float major = std::max(own.major, std::sqrt(after));
    const Vec3f along = own.cosine * u + own.sine * v;
    const Vec3f across = own.cosine * v - own.sine * u;
    cells_.u.set(stays, major / own.major * along);
    cells_.v.set(stays, after / (major * own.minor) * across);
  }

  const MultiresSurface& surface_;
  const Sampling& sampling_;
  const float closest_;
  Cells cells_;
  std::vector<std::uint8_t> may_go_;
  std::vector<std::uint8_t> gone_;
  std::vector<std::uint32_t> members_;  // ascending
  bool inserted_alone_ = false;
};

// The row of sample i without who is gone: its neighbours, and where these are too few, theirs. False where
// too few are left nearby to say who is nearest.
bool fill_row(const NeighborGraph& graph, const std::vector<std::uint8_t>& gone, const Points& position,
              std::uint32_t i, std::vector<std::uint32_t>& row) {
  std::vector<std::uint32_t> visited{i};
  std::vector<Neighbor> alive;
  const std::size_t enough = 2 * std::size_t{graph.k};
  for (std::size_t next = 0; next < visited.size(); ++next) {
    // Whole rings only, and one beyond what would be enough: the nearest may be a ring farther out.
    if (alive.size() >= enough || visited.size() >= kMostVisited) break;
    for (std::uint32_t j = 0; j < graph.k; ++j) {
      const std::uint32_t other = graph.index(visited[next], j);
      if (std::find(visited.begin(), visited.end(), other) != visited.end()) continue;
      visited.push_back(other);
      const float distance = (position[other] - position[i]).squaredNorm();
      if (gone[other] == 0 && distance > 0.0F) alive.push_back({.index = other, .distance_sq = distance});
    }
  }
  std::sort(alive.begin(), alive.end());
  row.clear();
  for (std::size_t j = 0; j < std::min<std::size_t>(graph.k, alive.size()); ++j)
    row.push_back(alive[j].index);
  return alive.size() >= enough;
}

// Rows of survivors found among all of them, by their new numbers.
void search_rows(const std::vector<std::uint32_t>& rows, const Points& position, NeighborGraph& graph) {
  if (rows.empty() || graph.k == 0) return;
  const KdTree tree(position);
  parallel_for(rows.size(), [&](std::size_t begin, std::size_t end) {
    std::vector<Neighbor> found;
    for (std::size_t r = begin; r < end; ++r) {
      const std::uint32_t m = rows[r];
      tree.nearest(position[m], graph.k + kCopies, found);
      // Neither itself nor, where there are others, a copy of it.
      std::erase_if(found, [m](const Neighbor& near) { return near.index == m; });
      if (found.back().distance_sq > 0.0F)
        std::erase_if(found, [](const Neighbor& near) { return !(near.distance_sq > 0.0F); });
      for (std::uint32_t j = 0; j < graph.k; ++j)
        graph.index(m, j) = found[std::min<std::size_t>(j, found.size() - 1)].index;
    }
  });
}

NeighborGraph survivors_graph(const NeighborGraph& graph, const std::vector<std::uint8_t>& gone,
                              const std::vector<std::uint32_t>& order, const Points& position) {
  std::vector<std::uint32_t> number(gone.size(), 0);
  for (std::size_t m = 0; m < order.size(); ++m) number[order[m]] = static_cast<std::uint32_t>(m);
  NeighborGraph left{.count = order.size(), .k = graph.k, .lanes = {}, .duplicate_count = 0};
  left.k = static_cast<std::uint32_t>(std::min<std::size_t>(graph.k, order.size() - 1));
  left.lanes.resize(padded_to_block(left.count) * left.k, 0);
  std::vector<std::uint8_t> searched(order.size(), 0);
  parallel_for(order.size(), [&](std::size_t begin, std::size_t end) {
    std::vector<std::uint32_t> row;
    for (std::size_t m = begin; m < end; ++m) {
      row.clear();
      bool whole = true;
      for (std::uint32_t j = 0; j < graph.k; ++j) {
        row.push_back(graph.index(order[m], j));
        whole = whole && gone[row.back()] == 0;
      }
      if (!whole && !fill_row(graph, gone, position, order[m], row)) {
        searched[m] = 1;
        continue;
      }
      for (std::uint32_t j = 0; j < left.k; ++j) left.index(m, j) = number[row[j]];
    }
  });
  std::vector<std::uint32_t> rows;
  for (std::size_t m = 0; m < searched.size(); ++m)
    if (searched[m] != 0) rows.push_back(static_cast<std::uint32_t>(m));
  search_rows(rows, gathered(position, order), left);
  return left;
}

// The parents, where an inserted one is gone that one's own: whoever stays descends from somebody.
std::vector<std::uint32_t> adopted(const Sampling& sampling, const std::vector<std::uint8_t>& gone) {
  std::vector<std::uint32_t> parent = sampling.parent;
  std::unordered_map<std::uint32_t, std::uint32_t> parent_of_gone;  // by id
  for (std::size_t i = 0; i < parent.size(); ++i)
    if (gone[i] != 0 && parent[i] != kNoParent) parent_of_gone.emplace(sampling.cloud->id[i], parent[i]);
  for (std::uint32_t& id : parent) {
    for (auto found = parent_of_gone.find(id); found != parent_of_gone.end(); found = parent_of_gone.find(id))
      id = found->second;
  }
  return parent;
}

}  // namespace

void collect(const ScaleField& field, float closest, ResampledEdit& result, const ExecutionContext* context) {
  const Sampling& sampling = *result.sampling;
  Collection collection(result.surface, sampling, field, closest);
  // Inserted samples first, all that stand too close to anybody: originals take their cells back.
  for (const bool inserted_alone : {true, false}) {
    for (std::size_t round = 0; round < kMostRounds && collection.round(inserted_alone); ++round) {
      if (context != nullptr && context->is_cancelled()) return;
    }
  }
  const std::vector<std::uint32_t> order = collection.survivors();
  result.removed = sampling.size() - order.size();
  if (result.removed == 0) return;
  auto left = std::make_shared<Sampling>();
  left->cloud = std::make_shared<const Cloud>(permuted(*sampling.cloud, order));
  left->graph = std::make_shared<const NeighborGraph>(
      survivors_graph(*sampling.graph, collection.gone(), order, result.surface.finest().position));
  left->spacing = gathered(sampling.spacing, order);
  left->parent = gathered(adopted(sampling, collection.gone()), order);
  left->cell_u = gathered(collection.cells().u, order);
  left->cell_v = gathered(collection.cells().v, order);
  left->next_id = sampling.next_id;
  for (Level& level : result.surface.levels) {
    level.position = gathered(level.position, order);
    level.normal = gathered(level.normal, order);
  }
  for (std::vector<float>& detail : result.surface.detail) detail = gathered(detail, order);
  result.sampling = std::move(left);
}

}  // namespace pointwright

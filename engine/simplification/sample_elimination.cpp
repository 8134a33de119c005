// C. Yuksel, "Sample elimination for generating Poisson disk sample sets", 2015; independent maxima as in M.
// T. Jones and P. E. Plassmann, "A parallel graph coloring heuristic", 1993.
#include "engine/simplification/sample_elimination.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <numbers>
#include <span>

#include "engine/core/check.h"
#include "engine/core/parallel.h"
#include "engine/simplification/contraction.h"
#include "engine/spatial/block_tree.h"

namespace pointwright {
namespace {

// On a surface with six samples for each that stays there are 24 within r.
constexpr std::uint32_t kNeighbors = 24;
// Few, so that on curves and near borders the room is hardly taken for more than it is.
constexpr std::uint32_t kRoomNeighbors = 6;
constexpr std::size_t kFewCut = 8;  // an eighth of the lists may end before r
// A little farther than Yuksel's, who has many times more samples to choose from: 1 leaves greater gaps, 1.1
// less distance.
constexpr double kReach = 1.05;
constexpr double kClumpShare = 0.65;  // Yuksel's beta; his gamma is 3/2
// Nearer than that weights grow by this, linearly: all the same, as he has them, they leave adjacent pairs of
// a lattice.
constexpr float kSlope = 0.5F;

constexpr std::size_t blocks_of(std::size_t count) {
  return (count + kParallelBlock - 1) / kParallelBlock;
}

// As the tree computes it, so that the two agree on who is among the nearest.
float distance_sq(const Points& position, std::size_t a, std::size_t b) {
  const float x = position.x()[a] - position.x()[b];
  const float y = position.y()[a] - position.y()[b];
  const float z = position.z()[a] - position.z()[b];
  return x * x + y * y + z * z;
}

// Weights are whole numbers, so that sums are the same in any order.
std::uint64_t share_of(float weight) {
  constexpr float kOne = 0x1p50F;
  return static_cast<std::uint64_t>(weight * kOne);
}

// That a sample goes, and its weight then. Of equal weights chance decides which is the first: by index a
// lattice would go one row a round.
struct Elimination {
  std::uint64_t weight;
  std::uint32_t sample;
  friend bool operator<(const Elimination& a, const Elimination& b) {
    return a.weight != b.weight ? a.weight > b.weight : tie_key(0, a.sample) < tie_key(0, b.sample);
  }
};

// The lists of all parallel blocks, one after the other.
template <typename T>
std::vector<T> joined(const std::vector<std::vector<T>>& parts) {
  std::size_t count = 0;
  for (const auto& part : parts) count += part.size();
  std::vector<T> all;
  all.reserve(count);
  for (const auto& part : parts) all.insert(all.end(), part.begin(), part.end());
  return all;
}

class Eliminator {
 public:
  Eliminator(const Points& position, const Points& normal, std::size_t wanted,
             const ExecutionContext* context)
      : position_(position), normal_(normal), wanted_(wanted), count_(position.size()), context_(context) {}

  std::vector<std::uint32_t> run() {
    find_neighbors(kNeighbors);
    if (is_cancelled()) return {};
    find_radius();
    if (is_cut_short()) {
      find_neighbors(2 * kNeighbors);
      if (is_cancelled()) return {};
    }
    weigh_pairs();
    while (!active_.empty() && !is_cancelled()) play_round();
    std::vector<std::uint32_t> samples(removed_.size());
    std::transform(removed_.begin(), removed_.end(), samples.begin(),
                   [](const Elimination& one) { return one.sample; });
    return samples;
  }

 private:
  // Of a parallel block, one sample's pairs after the other's: neighbours apart from weights, since most
  // looks at a row end at its first entries.
  struct Pairs {
    std::vector<std::uint32_t> other;
    std::vector<float> weight;
  };
  struct Row {
    std::uint32_t first;
    std::uint32_t count;
  };
  [[nodiscard]] std::span<const std::uint32_t> neighbors(std::uint32_t i) const {
    return std::span(pairs_[i / kParallelBlock].other).subspan(row_[i].first, row_[i].count);
  }
  [[nodiscard]] const float* weights(std::uint32_t i) const {
    return pairs_[i / kParallelBlock].weight.data() + row_[i].first;
  }

  [[nodiscard]] bool goes_before(std::uint32_t a, std::uint32_t b) const {
    return Elimination{weight_[a], a} < Elimination{weight_[b], b};
  }
  [[nodiscard]] bool is_cancelled() const { return context_ != nullptr && context_->is_cancelled(); }
  [[nodiscard]] bool same_side(std::size_t a, std::size_t b) const {
    return normal_.empty() || !(normal_[a].dot(normal_[b]) < 0.0F);
  }

  void find_neighbors(std::uint32_t length);
  void find_radius();
  [[nodiscard]] bool is_cut_short() const;
  void weigh_pairs();
  void play_round();
  template <typename Wanted>
  std::vector<std::vector<std::uint32_t>> active_where(const Wanted& wanted) const;
  std::vector<std::vector<std::uint32_t>> find_leaving();
  void take_out(const std::vector<std::vector<std::uint32_t>>& leaving);
  void keep_active();

  const Points& position_;
  const Points& normal_;
  std::size_t wanted_;
  std::size_t count_;
  const ExecutionContext* context_;

  std::uint32_t length_ = 0;                        // of the lists of nearest samples
  std::vector<std::vector<std::int32_t>> nearest_;  // of a parallel block: [block][j][lane]
  std::vector<float> reach_sq_;                     // squared distance of the last of these
  std::vector<std::uint32_t> last_;
  std::vector<float> area_;  // that a sample has to itself
  float radius_ = 0.0F;
  float clump_ = 0.0F;

  std::vector<Pairs> pairs_;  // of a parallel block
  std::vector<Row> row_;
  std::vector<std::uint64_t> weight_;
  std::vector<std::uint8_t> is_left_;
  std::vector<std::uint32_t> obstacle_;  // who went before it when it was last looked at
  std::vector<std::uint32_t> active_;    // may still go
  std::vector<Elimination> removed_;
  std::uint64_t threshold_ = 0;  // what weighs less stays
};

void Eliminator::find_neighbors(std::uint32_t length) {
  const BlockTree tree(position_);
  length_ = static_cast<std::uint32_t>(std::min<std::size_t>(length, count_ - 1));
  nearest_.resize(blocks_of(count_));
  reach_sq_.resize(count_);
  last_.resize(count_);
  area_.resize(count_);
  parallel_for(
      count_,
      [&](std::size_t begin, std::size_t end) {
        std::vector<std::int32_t>& lists = nearest_[begin / kParallelBlock];
        tree.nearest_of_range(begin, end, length_, std::numeric_limits<float>::infinity(), lists);
        for (std::size_t i = begin; i < end; ++i) {
          std::int32_t* const list =
              lists.data() + (i - begin) / kSimdBlock * length_ * kSimdBlock + i % kSimdBlock;
          std::uint32_t allies = 0;
          std::uint32_t farthest = static_cast<std::uint32_t>(i);  // of the allies that tell the room
          for (std::uint32_t j = 0; j < length_; ++j) {
            std::int32_t& other = list[j * kSimdBlock];
            last_[i] = static_cast<std::uint32_t>(other);
            if (!same_side(i, last_[i])) {
              other = -1;
            } else if (allies < kRoomNeighbors) {
              farthest = last_[i];
              ++allies;
            }
          }
          reach_sq_[i] = distance_sq(position_, i, last_[i]);
          const float room_sq = allies > 0 ? distance_sq(position_, i, farthest) : reach_sq_[i];
          area_[i] = std::numbers::pi_v<float> * room_sq / (static_cast<float>(allies) + 0.5F);
        }
      },
      kParallelBlock, context_);
}

// The cell of a hexagonal pattern has the area t = sqrt(3)/2 r^2. A sample with less room than that is kept
// with the probability area / t, one with more always: the expected count falls as t grows, so the steps from
// above end at the t where it is `wanted`.
void Eliminator::find_radius() {
  struct Room {
    double crowded = 0.0;
    double lone = 0.0;
    Room operator+(const Room& other) const { return {crowded + other.crowded, lone + other.lone}; }
  };
  double t = std::numeric_limits<double>::infinity();
  for (;;) {
    const Room room = parallel_sum<Room>(count_, {}, [&](std::size_t begin, std::size_t end) {
      Room part;
      for (std::size_t i = begin; i < end; ++i) {
        const auto area = static_cast<double>(area_[i]);
        (area < t ? part.crowded : part.lone) += area < t ? area : 1.0;
      }
      return part;
    });
    const double next = room.crowded / (static_cast<double>(wanted_) - room.lone);
    if (!(next < t && next > 0.0)) break;
    t = next;
  }
  if (!std::isfinite(t)) t = 0.0;  // everything in one place
  const double radius = kReach * std::sqrt(2.0 * t / std::numbers::sqrt3);
  const double ratio = static_cast<double>(wanted_) / static_cast<double>(count_);
  radius_ = static_cast<float>(radius);
  clump_ = static_cast<float>(kClumpShare * (1.0 - ratio * std::sqrt(ratio)) * radius);
}

// Whether more than a few lists end before the radius does: two sheets fill them twice as fast.
bool Eliminator::is_cut_short() const {
  const auto cut = std::count_if(reach_sq_.begin(), reach_sq_.end(),
                                 [&](float reach_sq) { return reach_sq < radius_ * radius_; });
  return length_ < count_ - 1 && static_cast<std::size_t>(cut) > count_ / kFewCut;
}

void Eliminator::weigh_pairs() {
  pairs_.resize(blocks_of(count_));
  row_.resize(count_);
  weight_.resize(count_);
  is_left_.assign(count_, 1);
  obstacle_.resize(count_);
  active_.resize(count_);
  parallel_for(
      count_,
      [&](std::size_t begin, std::size_t end) {
        std::vector<std::int32_t>& lists = nearest_[begin / kParallelBlock];
        Pairs& pairs = pairs_[begin / kParallelBlock];
        pairs.other.resize((end - begin) * length_);
        pairs.weight.resize((end - begin) * length_);
        std::uint32_t at = 0;
        for (std::size_t i = begin; i < end; ++i) {
          const std::int32_t* const list =
              lists.data() + (i - begin) / kSimdBlock * length_ * kSimdBlock + i % kSimdBlock;
          const std::uint32_t first = at;
          std::uint64_t sum = 0;
          for (std::uint32_t j = 0; j < length_; ++j) {
            if (list[j * kSimdBlock] < 0) continue;
            const auto other = static_cast<std::uint32_t>(list[j * kSimdBlock]);
            const float d_sq = distance_sq(position_, i, other);
            // Only where each is among the other's nearest: what one sample does to another, that does to it.
            if (d_sq > reach_sq_[other] || (d_sq == reach_sq_[other] && i > last_[other])) continue;
            const float d = std::sqrt(d_sq);
            if (!(d < radius_)) break;
            const float one = 1.0F - std::max(d, clump_) / radius_;
            const float four = (one * one) * (one * one);
            pairs.other[at] = other;
            const float nearer = std::max(0.0F, 1.0F - d / clump_);
            const float weight = four * four * (1.0F + kSlope * nearer);
            pairs.weight[at++] = weight;
            sum += share_of(weight);
          }
          row_[i] = {first, at - first};
          weight_[i] = sum;
          obstacle_[i] = static_cast<std::uint32_t>(i);
          active_[i] = static_cast<std::uint32_t>(i);
        }
        lists = {};
      },
      kParallelBlock, context_);
}

// Of the samples that may still go, those that `wanted` says yes to, parallel block by parallel block.
template <typename Wanted>
std::vector<std::vector<std::uint32_t>> Eliminator::active_where(const Wanted& wanted) const {
  std::vector<std::vector<std::uint32_t>> found(blocks_of(active_.size()));
  parallel_for(
      active_.size(),
      [&](std::size_t begin, std::size_t end) {
        std::vector<std::uint32_t>& here = found[begin / kParallelBlock];
        for (std::size_t a = begin; a < end; ++a) {
          if (wanted(active_[a])) here.push_back(active_[a]);
        }
      },
      kParallelBlock, context_);
  return found;
}

// The samples that go before all their neighbours.
std::vector<std::vector<std::uint32_t>> Eliminator::find_leaving() {
  return active_where([this](std::uint32_t i) {
    const std::uint32_t before = obstacle_[i];
    if (before != i && is_left_[before] != 0 && goes_before(before, i)) return false;
    const std::span<const std::uint32_t> row = neighbors(i);
    const auto found = std::find_if(row.begin(), row.end(), [&](std::uint32_t other) {
      return is_left_[other] != 0 && goes_before(other, i);
    });
    if (found == row.end()) return true;
    obstacle_[i] = *found;
    return false;
  });
}

void Eliminator::take_out(const std::vector<std::vector<std::uint32_t>>& leaving) {
  parallel_for(
      leaving.size(),
      [&](std::size_t begin, std::size_t end) {
        for (std::size_t b = begin; b < end; ++b) {
          for (const std::uint32_t i : leaving[b]) {
            is_left_[i] = 0;
            // None of its neighbours leaves in the same round.
            const float* weight = weights(i);
            for (const std::uint32_t other : neighbors(i)) {
              const std::uint64_t share = share_of(*weight++);
              if (is_left_[other] == 0) continue;
              std::atomic_ref(weight_[other]).fetch_sub(share, std::memory_order_relaxed);
            }
          }
        }
      },
      1);
  for (const std::uint32_t i : joined(leaving)) removed_.push_back({weight_[i], i});
  const std::size_t excess = count_ - wanted_;
  if (removed_.size() < excess) return;
  const auto end = removed_.begin() + static_cast<std::ptrdiff_t>(excess);
  std::nth_element(removed_.begin(), end - 1, removed_.end());
  threshold_ = removed_[excess - 1].weight;
  // What went too early stays. Its neighbours weigh less than it does, so they stay, too.
  removed_.resize(excess);
}

void Eliminator::keep_active() {
  active_ =
      joined(active_where([this](std::uint32_t i) { return is_left_[i] != 0 && weight_[i] >= threshold_; }));
}

void Eliminator::play_round() {
  const std::vector<std::vector<std::uint32_t>> leaving = find_leaving();
  if (is_cancelled()) return;
  take_out(leaving);
  keep_active();
}

}  // namespace

std::vector<std::uint32_t> eliminate_samples(const Points& position, const Points& normal, std::size_t wanted,
                                             const ExecutionContext* context) {
  POINTWRIGHT_CHECK(wanted >= 1 && wanted < position.size(), "some samples must go, and some stay");
  POINTWRIGHT_CHECK(normal.empty() || normal.size() == position.size(), "normals must be of these points");
  return Eliminator(position, normal, wanted, context).run();
}

}  // namespace pointwright

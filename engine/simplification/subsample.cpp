#include "engine/simplification/subsample.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <numeric>

#include "engine/core/out_of_range.h"
#include "engine/core/parallel.h"
#include "engine/simplification/contraction.h"
#include "engine/simplification/sample_elimination.h"
#include "engine/spatial/morton_code.h"

namespace pointwright {
namespace {

constexpr std::size_t kMostIndexed = (std::size_t{1} << 31U) - 1;  // what kernels can index
constexpr std::size_t kCandidates = 5;                             // for each sample that is wanted

// The leading bits of a Morton code that a sample shares with the one before it: kBits where the codes are
// equal, one more where the places are.
constexpr std::size_t kSamePlace = MortonCode::kBits + 1;

std::vector<std::uint8_t> shared_bits(const Points& position, const ExecutionContext* context) {
  const MortonCode code(bounds_of(position));
  std::vector<std::uint8_t> shared(position.size(), 0);
  parallel_for(
      position.size(),
      [&](std::size_t begin, std::size_t end) {
        std::uint64_t before = code.of(position[begin > 0 ? begin - 1 : 0]);
        for (std::size_t i = begin; i < end; ++i) {
          const std::uint64_t here = code.of(position[i]);
          const bool same_place = i > 0 && position[i] == position[i - 1];
          shared[i] =
              same_place ? kSamePlace : static_cast<std::uint8_t>(std::countl_zero(here ^ before) - 1);
          before = here;
        }
      },
      kParallelBlock, context);
  return shared;
}

// The fewest bits that give at least so many cells; kSamePlace, every place a cell, where none do.
std::size_t bits_for(const std::vector<std::uint8_t>& shared, std::size_t wanted_cells) {
  struct Histogram {
    std::array<std::size_t, kSamePlace + 1> count{};
    Histogram operator+(const Histogram& other) const {
      Histogram sum = *this;
      for (std::size_t b = 0; b <= kSamePlace; ++b) sum.count[b] += other.count[b];
      return sum;
    }
  };
  const Histogram all = parallel_sum<Histogram>(
      shared.size(), {},
      [&](std::size_t begin, std::size_t end) {
        Histogram part;
        for (std::size_t i = begin; i < end; ++i) ++part.count[shared[i]];
        return part;
      },
      kParallelBlock * 16);
  std::size_t bits = 0;
  // The first sample starts a cell, whatever it shares.
  for (std::size_t cells = 1; bits < kSamePlace && cells < wanted_cells; ++bits) cells += all.count[bits];
  return bits;
}

// One sample by chance of each run that shares a cell, and one of those that oppose its first.
std::vector<std::uint32_t> one_a_cell(const Points& normal, const std::vector<std::uint8_t>& shared,
                                      std::size_t bits, const ExecutionContext* context) {
  const std::size_t n = shared.size();
  const auto starts_cell = [&](std::size_t i) { return i == 0 || shared[i] < bits; };
  std::vector<std::vector<std::uint32_t>> parts((n + kParallelBlock - 1) / kParallelBlock);
  parallel_for(
      n,
      [&](std::size_t begin, std::size_t end) {
        std::vector<std::uint32_t>& part = parts[begin / kParallelBlock];
        while (begin < end && !starts_cell(begin)) ++begin;
        while (begin < end) {
          struct Choice {
            std::uint64_t key = 0;
            std::uint32_t sample = 0;
          };
          std::array<Choice, 2> sides{};  // the greatest key of each side, which is never 0 but for none
          std::size_t to = begin;
          do {
            const bool opposed = !normal.empty() && normal[to].dot(normal[begin]) < 0.0F;
            const auto sample = static_cast<std::uint32_t>(to);
            const std::uint64_t key = tie_key(1, sample);
            if (Choice& side = sides[opposed ? 1 : 0]; key > side.key) side = {key, sample};
          } while (++to < n && !starts_cell(to));
          if (sides[1].key != 0 && sides[1].sample < sides[0].sample) std::swap(sides[0], sides[1]);
          for (const Choice& side : sides) {
            if (side.key != 0) part.push_back(side.sample);
          }
          begin = to;
        }
      },
      kParallelBlock, context);
  std::vector<std::uint32_t> chosen;
  for (const auto& part : parts) chosen.insert(chosen.end(), part.begin(), part.end());
  return chosen;
}

// Adds so many of the others, spread over the order, to an ascending list.
std::vector<std::uint32_t> filled_up(const std::vector<std::uint32_t>& chosen, std::size_t count,
                                     std::size_t wanted) {
  const std::uint64_t missing = wanted - chosen.size();
  const std::uint64_t others = count - chosen.size();
  std::vector<std::uint32_t> result;
  result.reserve(wanted);
  auto next = chosen.begin();
  std::uint64_t other = 0;
  for (std::uint32_t i = 0; i < count; ++i) {
    if (next != chosen.end() && *next == i) {
      result.push_back(*next++);
    } else if (const std::uint64_t before = other++; other * missing / others > before * missing / others) {
      result.push_back(i);
    }
  }
  return result;
}

// Of these columns, at unit scale so that no square underflows.
struct Candidates {
  Points position;
  Points normal;
};
Candidates candidates_of(const Points& position, const Points& normal,
                         const std::vector<std::uint32_t>& chosen) {
  const float scale = unit_scale(position);
  Candidates result{.position = Points(chosen.size()), .normal = Points(normal.empty() ? 0 : chosen.size())};
  parallel_for(chosen.size(), [&](std::size_t begin, std::size_t end) {
    for (std::size_t m = begin; m < end; ++m) {
      result.position.set(m, position[chosen[m]] * scale);
      if (!normal.empty()) result.normal.set(m, normal[chosen[m]]);
    }
  });
  return result;
}

}  // namespace

Result<void> validate(const SubsampleParams& params) {
  return std::visit([](const auto& target) { return validate(SimplifyParams{.target = target}); },
                    params.target);
}

Result<std::vector<std::uint32_t>> subsample(const Points& position, const Points& normal,
                                             const SubsampleParams& params, const ExecutionContext* context) {
  if (const auto valid = validate(params); !valid) return valid.error();
  const std::size_t n = position.size();
  POINTWRIGHT_CHECK(normal.empty() || normal.size() == n, "normals must be of these points");
  if (n > kMostIndexed) {
    return too_large("too many samples to choose from at once", "position", static_cast<double>(kMostIndexed),
                     static_cast<double>(n));
  }
  const std::size_t wanted =
      std::visit([n](const auto& target) { return kept_of(target, n); }, params.target);
  const auto is_cancelled = [&] { return context != nullptr && context->is_cancelled(); };
  std::vector<std::uint32_t> all(n);
  std::iota(all.begin(), all.end(), 0U);
  if (wanted == n) return all;

  const std::vector<std::uint8_t> shared = shared_bits(position, context);
  if (is_cancelled()) return cancelled_error();
  const std::vector<std::uint32_t> chosen =
      one_a_cell(normal, shared, bits_for(shared, kCandidates * wanted), context);
  if (is_cancelled()) return cancelled_error();
  if (chosen.size() <= wanted) return filled_up(chosen, n, wanted);

  const Candidates candidates = candidates_of(position, normal, chosen);
  const std::vector<std::uint32_t> gone =
      eliminate_samples(candidates.position, candidates.normal, wanted, context);
  if (is_cancelled()) return cancelled_error();
  std::vector<std::uint8_t> stays(chosen.size(), 1);
  for (const std::uint32_t m : gone) stays[m] = 0;
  std::vector<std::uint32_t> kept;
  kept.reserve(wanted);
  for (std::size_t m = 0; m < chosen.size(); ++m) {
    if (stays[m] != 0) kept.push_back(chosen[m]);
  }
  return kept;
}

}  // namespace pointwright

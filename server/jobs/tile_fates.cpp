#include "server/jobs/tile_fates.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <utility>
#include <variant>

#include "engine/core/check.h"
#include "engine/core/parallel.h"
#include "engine/multires/sampling.h"

namespace pointwright::server {
namespace {

const std::byte* record_of(const TileSource& source, std::uint64_t index) {
  return source.file.bytes().data() + source.records.begin + index * source.records.record_bytes;
}

/// float32 holds all numbers of the type.
bool is_short(ScalarType type) {
  return type != ScalarType::kDouble && type != ScalarType::kInt32 && type != ScalarType::kUint32;
}

/// Whether an edit has turned the normal: what import makes of a length that is not 1 is no turn.
bool turned(const Vec3f& before, const Vec3f& after) {
  if (before == after) return false;
  const float length = before.norm();
  return !(length > 1e-6F) || !std::isfinite(length) ? false : Vec3f(before / length) != after;
}

/// In the tile's cloud, by id; inserted samples have greater ones.
std::vector<std::uint32_t> places_of_ids(const TileInput& input) {
  std::vector<std::uint32_t> places(input.index.size());
  for (std::size_t i = 0; i < places.size(); ++i) places[input.cloud->id[i]] = static_cast<std::uint32_t>(i);
  return places;
}

/// By id.
std::vector<std::uint8_t> own_samples(const TileInput& input) {
  std::vector<std::uint8_t> is_own(input.index.size(), 0);
  for (const std::uint32_t i : input.by_index) is_own[input.cloud->id[i]] = 1;
  return is_own;
}

class Fates {
 public:
  Fates(const TileSource& source, const TileInput& input, const TransferredSamples& made, const Points& rest,
        const Points& shown)
      : source_(source), input_(input), made_(made), rest_(rest), shown_(shown) {
    const std::vector<std::uint32_t> place = places_of_ids(input);
    const std::vector<std::uint32_t>& ids = made.sampling->cloud->id;
    now_.assign(input.index.size(), kNoParent);
    for (std::size_t j = 0; j < ids.size(); ++j)
      if (ids[j] < place.size()) now_[place[ids[j]]] = static_cast<std::uint32_t>(j);
  }

  Result<TileResult> result() {
    TileResult result;
    add_own(result);
    if (!made_.sampling->parent.empty())
      if (auto added = add_inserted(result); !added) return added.error();
    return result;
  }

 private:
  struct Fate {
    TileSample sample;
    float rest_distance = 0.0F;
    float difference = 0.0F;  // NaN: the preview shows none
    bool moved = false;
  };

  [[nodiscard]] Fate fate_of(std::uint32_t i) const {
    const std::uint32_t j = now_[i];
    const Vec3f before = input_.cloud->position[i];
    const Vec3f p = made_.surface.finest().position[j];
    const Vec3f n = made_.surface.finest().normal[j];
    const std::uint32_t anchor = made_.anchor[j];
    const Vec3f apart = (p - before) - (shown_[anchor] - rest_[anchor]);
    return {.sample = sample_of(input_.index[i], j),
            .rest_distance = (before - rest_[anchor]).norm(),
            .difference = apart.norm(),
            // Normals that are no directions stay as they are where the sample does.
            .moved = p != before || (source_.records.has_normals() && turned(input_.cloud->normal[i], n))};
  }

  [[nodiscard]] TileSample sample_of(std::uint64_t index, std::uint32_t j) const {
    const Vec3f p = made_.surface.finest().position[j];
    const Vec3f n = made_.surface.finest().normal[j];
    return {.index = index, .position = {p.x(), p.y(), p.z()}, .normal = {n.x(), n.y(), n.z()}};
  }

  void add_own(TileResult& result) const {
    const std::vector<std::uint32_t>& own = input_.by_index;
    std::vector<Fate> fates(own.size());
    parallel_for(own.size(), [&](std::size_t begin, std::size_t end) {
      for (std::size_t k = begin; k < end; ++k)
        if (now_[own[k]] != kNoParent) fates[k] = fate_of(own[k]);
    });
    constexpr std::size_t kNone = ~std::size_t{0};
    std::vector<std::size_t> best(rest_.size(), kNone);
    // In the scan's order: of equally near ones the first counts.
    for (std::size_t k = 0; k < own.size(); ++k) {
      if (now_[own[k]] == kNoParent) {
        result.removed.push_back(input_.index[own[k]]);
        continue;
      }
      const Fate& fate = fates[k];
      if (fate.moved) result.moved.push_back(fate.sample);
      std::size_t& nearest = best[made_.anchor[now_[own[k]]]];
      if (nearest == kNone || fate.rest_distance < fates[nearest].rest_distance) nearest = k;
    }
    for (std::uint32_t anchor = 0; anchor < best.size(); ++anchor) {
      if (best[anchor] == kNone) continue;
      const Fate& fate = fates[best[anchor]];
      if (std::isfinite(fate.difference))
        result.matches.push_back(
            {.anchor = anchor, .rest_distance = fate.rest_distance, .difference = fate.difference});
    }
  }

  Result<void> add_inserted(TileResult& result) const {
    const std::vector<std::uint32_t> roots = roots_of(*made_.sampling);
    const std::vector<std::uint8_t> is_own = own_samples(input_);
    const std::vector<std::uint32_t> place = places_of_ids(input_);
    std::vector<std::pair<std::uint64_t, std::uint32_t>> inserted;  // root in the scan, place
    for (std::uint32_t j = 0; j < roots.size(); ++j)
      if (made_.sampling->parent[j] != kNoParent && is_own[roots[j]] != 0)
        inserted.emplace_back(input_.index[place[roots[j]]], j);
    // Siblings in the order in which they were born.
    std::sort(inserted.begin(), inserted.end());
    const std::uint64_t size = source_.records.record_bytes;
    result.roots.resize(inserted.size());
    result.records.resize(inserted.size() * size);
    std::atomic<bool> unsaid{false};
    parallel_for(inserted.size(), [&](std::size_t begin, std::size_t end) {
      for (std::size_t k = begin; k < end; ++k) {
        result.roots[k] = inserted[k].first;
        if (!write_record(inserted[k].second, result.records.data() + k * size)) unsaid = true;
      }
    });
    source_.file.release(source_.records.begin, source_.records.end());
    if (unsaid) return unsaid_place();
    return {};
  }

  /// False: the record cannot say the place.
  bool write_record(std::uint32_t j, std::byte* record) const {
    const ScanRecords& records = source_.records;
    const Cloud& cloud = *made_.sampling->cloud;
    const auto whose = static_cast<std::uint32_t>(value_of(cloud.scalars.front(), j));
    std::copy_n(record_of(source_, input_.index[whose]), records.record_bytes, record);
    const Vec3f p = made_.surface.finest().position[j];
    const Vec3d place = cloud.origin + p.cast<double>();
    if (!records.can_say(place)) return false;
    records.set_position(record, place);
    if (records.has_normals()) records.set_normal(record, made_.surface.finest().normal[j]);
    for (std::size_t k = 0; k < records.mixed().size(); ++k)
      records.set_number(record, records.mixed()[k], value_of(cloud.scalars[k + 1], j));
    if (records.texture())
      for (std::size_t axis = 0; axis < 2; ++axis)
        records.set_number(record, (*records.texture()).at(axis),
                           static_cast<double>(cloud.texcoord[j].at(axis)));
    return true;
  }

  static double value_of(const ScalarAttribute& scalar, std::size_t j) {
    return std::visit([j](const auto& values) { return static_cast<double>(values[j]); }, scalar.values);
  }

  const TileSource& source_;
  const TileInput& input_;
  const TransferredSamples& made_;
  const Points& rest_;
  const Points& shown_;
  std::vector<std::uint32_t> now_;  // by place in the input: that after the edits; kNoParent: collected
};

}  // namespace

void take_record_values(const TileSource& source, TileInput& input) {
  const ScanRecords& records = source.records;
  const std::size_t count = input.index.size();
  Cloud& cloud = *input.cloud;
  // Whole numbers are the nearest sample's: so is the record that they stand in.
  std::vector<std::uint32_t> whose(count);
  for (std::size_t i = 0; i < count; ++i) whose[i] = static_cast<std::uint32_t>(i);
  cloud.scalars.push_back({.name = {}, .values = std::move(whose)});
  for (const ScanRecords::Place& place : records.mixed()) {
    if (is_short(place.type))
      cloud.scalars.push_back({.name = {}, .values = std::vector<float>(count)});
    else
      cloud.scalars.push_back({.name = {}, .values = std::vector<double>(count)});
  }
  if (records.texture()) cloud.texcoord.resize(count);
  parallel_for(count, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const std::byte* const record = record_of(source, input.index[i]);
      for (std::size_t k = 0; k < records.mixed().size(); ++k)
        std::visit(
            [&](auto& values) {
              using T = typename std::remove_reference_t<decltype(values)>::value_type;
              values[i] = static_cast<T>(records.number(record, records.mixed()[k]));
            },
            cloud.scalars[k + 1].values);
      if (records.texture())
        for (std::size_t axis = 0; axis < 2; ++axis)
          cloud.texcoord[i].at(axis) =
              static_cast<float>(records.number(record, (*records.texture()).at(axis)));
    }
  });
  source.file.release(records.begin, records.end());
}

Result<TileResult> result_of(const TileSource& source, const TileInput& input, const TransferredSamples& made,
                             const Points& rest, const Points& shown) {
  return Fates(source, input, made, rest, shown).result();
}

std::uint64_t own_count(const TileInput& input, const Sampling& sampling) {
  const std::vector<std::uint8_t> is_own = own_samples(input);
  std::uint64_t count = 0;
  for (const std::uint32_t root : roots_of(sampling)) count += is_own[root];
  return count;
}

Error unsaid_place() {
  return {.code = ErrorCode::kInvalidArgument,
          .message =
              "the edits take samples to where the file's whole numbers cannot say them: the mode memory "
              "chooses a grid that can, and so does PLY",
          .field = "deformation"};
}

}  // namespace pointwright::server

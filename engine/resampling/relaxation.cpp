#include "engine/resampling/relaxation.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "engine/core/parallel.h"
#include "engine/editing/deformation_map.h"
#include "engine/multires/normal_stencil.h"
#include "engine/resampling/relaxation_kernels.h"

namespace pointwright {
namespace {

constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();
constexpr std::uint32_t kSweepsOfF = 4;     // until F and U are evaluated anew
constexpr std::uint32_t kSweepsOfList = 4;  // and the lists
constexpr float kRadius = 1.9F;             // of repulsion, in local spacings
constexpr float kListRadius = 1.3F;         // what may come within the radius until the lists are made anew
constexpr float kGain = 1.2F;
constexpr float kMostStep = 0.125F;  // of the radius, in one sweep
constexpr float kLeastLocal = 0.3F;  // of the spacing wanted: local cells are taken to lie within
constexpr float kMostLocal = 1.5F;
constexpr float kMostWay = 0.65F;     // from the place of birth, in cells at rest
constexpr float kLeastPlane = 1e-6F;  // least det(U^T U) / trace² of a cell that is not folded flat
constexpr std::size_t kChildrenOfRange = 512;

static_assert(kMostFamilies == kRingSize + 1);

class Relaxation {
 public:
  Relaxation(const RelaxationScene& scene, Births& births, RelaxationMemory& memory)
      : scene_(scene),
        births_(births),
        memory_(memory),
        born_x_(births.x),
        born_y_(births.y),
        rings_(scene.splits.splits.size()),
        radius_(padded_to_block(births.x.size()), 0.0F),
        list_radius_(radius_.size(), 0.0F),
        count_(radius_.size(), 0),
        list_(radius_.size() * kMostRepelling),
        aside_(births.x.size()),
        push_(births.x.size()) {
    place_samples();
    make_rings();
  }

  void run(std::uint32_t sweeps, const ExecutionContext* context) {
    for (std::uint32_t sweep = 0; sweep < sweeps; ++sweep) {
      if (context != nullptr && context->is_cancelled()) return;
      if (sweep % kSweepsOfF == 0) evaluate();
      if (sweep % kSweepsOfList == 0) list_neighbors();
      repel_all();
      for_children([this](std::size_t child) { move(child); });
    }
  }

 private:
  [[nodiscard]] std::size_t before() const { return scene_.sampling.size(); }
  [[nodiscard]] const Split& split(std::size_t child) const {
    return scene_.splits.splits[births_.split[child]];
  }

  template <typename Body>
  void for_children(const Body& body) {
    parallel_for(
        births_.x.size(),
        [&](std::size_t begin, std::size_t end) {
          for (std::size_t child = begin; child < end; ++child) body(child);
        },
        kChildrenOfRange);
  }

  // Places of the samples that were there before. Memory that was used before has those that do not move.
  void place_samples() {
    Points& places = memory_.places;
    const bool fresh = places.size() < before();
    if (fresh) places = scene_.deformed;
    // Kernels read whole vectors from any child on.
    places.resize(before() + births_.x.size() + kSimdBlock);
    if (fresh) return;
    parallel_for(
        scene_.blocks.size(),
        [&](std::size_t begin, std::size_t end) {
          for (std::size_t entry = begin; entry < end; ++entry) {
            const std::size_t first = std::size_t{scene_.blocks[entry]} * kSimdBlock;
            for (std::size_t i = first; i < std::min(first + kSimdBlock, before()); ++i)
              places.set(i, scene_.deformed[i]);
          }
        },
        kParallelBlock / kSimdBlock);
  }

  void make_rings() {
    const std::vector<Split>& splits = scene_.splits.splits;
    std::vector<std::uint32_t>& split_of = memory_.split_of;
    split_of.resize(before(), kNone);
    for (std::size_t s = 0; s < splits.size(); ++s)
      split_of[splits[s].sample] = static_cast<std::uint32_t>(s);
    parallel_for(
        splits.size(),
        [&](std::size_t begin, std::size_t end) {
          for (std::size_t s = begin; s < end; ++s) set_ring(splits[s].sample, rings_[s]);
        },
        kChildrenOfRange);
    for (const Split& each : splits) split_of[each.sample] = kNone;
  }

  void set_ring(std::uint32_t sample, FamilyRing& ring) const {
    const RestPatch& patch = scene_.patches.of(sample);
    ring.count = patch.ring_size + 1;
    for (std::uint32_t r = 0; r < ring.count; ++r) {
      const std::uint32_t member = r == 0 ? sample : patch.ring[r - 1];
      const std::uint32_t s = memory_.split_of[member];
      ring.sample[r] = member;
      ring.begin[r] = ring.end[r] = 0;
      if (s == kNone) continue;
      ring.begin[r] = static_cast<std::uint32_t>(before()) + scene_.splits.splits[s].first_child;
      ring.end[r] = ring.begin[r] + scene_.splits.splits[s].children();
    }
  }

  // F and U of all children from where they stand at rest.
  void evaluate() {
    const std::size_t count = births_.x.size();
    Level rest{.position = Points(count), .normal = Points(count)};
    Cells tangents{.u = Points(count), .v = Points(count)};
    ShapeOperators shape;
    const bool offsets = scene_.map.step_count > 0 && scene_.map.step[0].kind == DeformKind::kAlongNormal;
    if (offsets) {
      for (auto* column : {&shape.uu, &shape.uv, &shape.vv}) column->resize(padded_to_block(count));
    }
    for_children([&](std::size_t child) {
      const RestPatch& patch = scene_.patches.of(split(child).sample);
      const float x = births_.x[child];
      const float y = births_.y[child];
      const Vec3f tangent_x = patch.tangent_x(x, y);
      const Vec3f tangent_y = patch.tangent_y(x, y);
      rest.position.set(child, patch.point(x, y));
      rest.normal.set(child, tangent_x.cross(tangent_y).normalized());
      tangents.u.set(child, tangent_x);
      tangents.v.set(child, tangent_y);
      if (offsets) set_shape(patch, rest.normal[child], tangent_x, tangent_y, child, shape);
    });
    const ScaleField field = compute_scale_field(rest.position, scene_.regions, scene_.blend);
    MappedCells mapped = map_cells(scene_.map, NormalStencil::all_blocks(count), field, rest, tangents,
                                   offsets ? &shape : nullptr);
    along_x_ = std::move(mapped.cells.u);
    along_y_ = std::move(mapped.cells.v);
    for_children([&](std::size_t child) {
      memory_.places.set(before() + child, mapped.position[child]);
      const float length = along_x_[child].norm();
      aside_.set(child, length > 0.0F ? Vec3f(along_x_[child] / length) : Vec3f::Zero());
      radius_[child] = repulsion_radius(child);
      list_radius_[child] = kListRadius * radius_[child];
    });
  }

  // Weingarten: dn of the jet, in the tangent frame of its normal.
  static void set_shape(const RestPatch& patch, const Vec3f& normal, const Vec3f& tangent_x,
                        const Vec3f& tangent_y, std::size_t child, ShapeOperators& shape) {
    const float bend = -normal.dot(patch.normal);
    const float xx = 2.0F * patch.jet[2] * bend;
    const float xy = patch.jet[3] * bend;
    const float yy = 2.0F * patch.jet[4] * bend;
    // The frame's axes in the basis of the tangents.
    const float a = tangent_x.squaredNorm();
    const float b = tangent_x.dot(tangent_y);
    const float c = tangent_y.squaredNorm();
    const float inverse = 1.0F / (a * c - b * b);  // >= 1: the tangents are a graph's
    const TangentFrame frame = tangent_frame(normal.cast<double>());
    std::array<std::array<float, 2>, 2> axis{};
    for (std::size_t e = 0; e < 2; ++e) {
      const Vec3f direction = (e == 0 ? frame.u : frame.v).cast<float>();
      const float p = direction.dot(tangent_x);
      const float q = direction.dot(tangent_y);
      axis[e] = {(c * p - b * q) * inverse, (a * q - b * p) * inverse};
    }
    const auto form = [&](const std::array<float, 2>& d, const std::array<float, 2>& e) {
      return d[0] * e[0] * xx + (d[0] * e[1] + d[1] * e[0]) * xy + d[1] * e[1] * yy;
    };
    shape.uu[child] = form(axis[0], axis[0]);
    shape.uv[child] = form(axis[0], axis[1]);
    shape.vv[child] = form(axis[1], axis[1]);
  }

  [[nodiscard]] float repulsion_radius(std::size_t child) const {
    const Split& own = split(child);
    const float wanted = wanted_spacing(scene_.sampling.spacing[own.sample], scene_.params, scene_.coarser);
    const float area =
        along_x_[child].cross(along_y_[child]).norm() *
        rest_area(scene_.rest.u[own.sample], scene_.rest.v[own.sample], scene_.sampling.spacing[own.sample]) /
        static_cast<float>(own.major * own.minor);
    return kRadius * std::clamp(std::sqrt(area), kLeastLocal * wanted, kMostLocal * wanted);
  }

  void list_neighbors() {
    const Points& places = memory_.places;
    const NearArgs args{.place = {places.x(), places.y(), places.z()},
                        .first_child = static_cast<std::uint32_t>(before()),
                        .ring = rings_.data(),
                        .ring_of = births_.split.data(),
                        .radius = list_radius_.data(),
                        .list = list_.data(),
                        .count = count_.data()};
    const auto kernel = POINTWRIGHT_KERNEL(list_near);
    parallel_for(
        births_.x.size(), [&](std::size_t begin, std::size_t end) { kernel(args, begin, end); },
        kChildrenOfRange);
  }

  void repel_all() {
    const Points& places = memory_.places;
    const RepelArgs args{.place = {places.x(), places.y(), places.z()},
                         .first_child = static_cast<std::uint32_t>(before()),
                         .list = list_.data(),
                         .count = count_.data(),
                         .radius = radius_.data(),
                         .aside = {aside_.x(), aside_.y(), aside_.z()},
                         .push = {push_.x(), push_.y(), push_.z()}};
    const auto kernel = POINTWRIGHT_KERNEL(repel);
    parallel_for(
        radius_.size() / kSimdBlock, [&](std::size_t begin, std::size_t end) { kernel(args, begin, end); },
        kChildrenOfRange / kSimdBlock);
  }

  void move(std::size_t child) {
    const Vec3f ux = along_x_[child];
    const Vec3f uy = along_y_[child];
    const float a = ux.squaredNorm();
    const float b = ux.dot(uy);
    const float c = uy.squaredNorm();
    const float determinant = a * c - b * b;
    if (!(determinant > kLeastPlane * (a + c) * (a + c))) return;
    const Vec3f push = kGain * push_[child];
    // The displacement's part in the tangent plane, at rest.
    const float p = ux.dot(push);
    const float q = uy.dot(push);
    float dx = (c * p - b * q) / determinant;
    float dy = (a * q - b * p) / determinant;
    const float length = (dx * ux + dy * uy).norm();
    const float most = kMostStep * radius_[child];
    if (length > most) {
      dx *= most / length;
      dy *= most / length;
    }
    const float old_x = births_.x[child];
    const float old_y = births_.y[child];
    confine(child, old_x + dx, old_y + dy);
    const Vec3f gone = (births_.x[child] - old_x) * ux + (births_.y[child] - old_y) * uy;
    memory_.places.set(before() + child, memory_.places[before() + child] + gone);
  }

  // Not too far from the place of birth; beyond the parent's own half cell only toward neighbours.
  void confine(std::size_t child, float x, float y) {
    const Split& own = split(child);
    const float cell = std::sqrt(
        rest_area(scene_.rest.u[own.sample], scene_.rest.v[own.sample], scene_.sampling.spacing[own.sample]));
    const float way_x = x - born_x_[child];
    const float way_y = y - born_y_[child];
    const float way = std::sqrt(way_x * way_x + way_y * way_y);
    const float kept = way > kMostWay * cell ? kMostWay * cell / way : 1.0F;
    x = born_x_[child] + kept * way_x;
    y = born_y_[child] + kept * way_y;
    const float distance = std::sqrt(x * x + y * y);
    if (distance > 0.5F * cell) {
      const RestPatch& patch = scene_.patches.of(own.sample);
      const Vec3f direction = x / distance * patch.u + y / distance * patch.v;
      const float born = std::sqrt(born_x_[child] * born_x_[child] + born_y_[child] * born_y_[child]);
      float reach = std::max(0.5F * cell, born);
      for (std::uint32_t r = 0; r < patch.ring_size; ++r)
        reach = std::max(reach, direction.dot(scene_.rest_position[patch.ring[r]] - patch.center));
      if (distance > reach) {
        x *= reach / distance;
        y *= reach / distance;
      }
    }
    births_.x[child] = x;
    births_.y[child] = y;
  }

  const RelaxationScene& scene_;
  Births& births_;
  RelaxationMemory& memory_;
  const std::vector<float> born_x_, born_y_;
  std::vector<FamilyRing> rings_;  // by split
  // By child.
  Points along_x_, along_y_;  // U: J of the patch's tangents
  std::vector<float> radius_, list_radius_;
  std::vector<std::uint32_t> count_;
  std::vector<std::uint32_t> list_;
  Points aside_, push_;
};

}  // namespace

void relax(const RelaxationScene& scene, std::uint32_t sweeps, Births& births, RelaxationMemory& memory,
           const ExecutionContext* context) {
  if (births.x.empty() || sweeps == 0) return;
  Relaxation(scene, births, memory).run(sweeps, context);
}

}  // namespace pointwright

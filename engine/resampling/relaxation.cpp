#include "engine/resampling/relaxation.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "engine/core/parallel.h"
#include "engine/editing/deformation_map.h"
#include "engine/multires/normal_stencil.h"

namespace pointwright {
namespace {

constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();
constexpr std::uint32_t kMostNeighbors = 32;  // of a list; a disc of the radius below holds about 20
constexpr std::uint32_t kSweepsOfList = 4;
constexpr float kRadius = 1.9F;      // of repulsion, in local spacings
constexpr float kListRadius = 1.3F;  // what may come within the radius until the lists are made anew
constexpr float kGain = 1.2F;
constexpr float kLeastWeight = 4.0F;  // lone neighbours must not throw a sample
constexpr float kMostStep = 0.125F;   // of the radius, in one sweep
constexpr float kLeastLocal = 0.3F;   // of the spacing wanted: local cells are taken to lie within
constexpr float kMostLocal = 1.5F;
constexpr float kMostWay = 0.5F;      // from the place of birth, in cells at rest
constexpr float kLeastPlane = 1e-6F;  // least det(U^T U) / trace² of a cell that is not folded flat
constexpr std::size_t kChildrenOfRange = 512;

// Children where the deformation has them.
struct Evaluated {
  Points position;
  Points along_x, along_y;  // U: J of the patch's tangents there
};

class Relaxation {
 public:
  Relaxation(const RelaxationScene& scene, Births& births)
      : scene_(scene),
        births_(births),
        born_x_(births.x),
        born_y_(births.y),
        split_of_(scene.sampling.size(), kNone),
        count_(births.x.size(), 0),
        radius_(births.x.size(), 0.0F),
        neighbors_(births.x.size() * kMostNeighbors),
        moved_(births.x.size()) {
    for (std::size_t s = 0; s < scene.splits.splits.size(); ++s)
      split_of_[scene.splits.splits[s].sample] = static_cast<std::uint32_t>(s);
  }

  void run(std::uint32_t sweeps, const ExecutionContext* context) {
    for (std::uint32_t sweep = 0; sweep < sweeps; ++sweep) {
      if (context != nullptr && context->is_cancelled()) return;
      if (sweep % kSweepsOfList == 0) {
        evaluate();
        for_children([this](std::size_t child) { list_neighbors(child); });
      }
      for_children([this](std::size_t child) { move(child); });
      std::swap(now_.position, moved_);
    }
  }

 private:
  template <typename Body>
  void for_children(const Body& body) {
    parallel_for(
        births_.x.size(),
        [&](std::size_t begin, std::size_t end) {
          for (std::size_t child = begin; child < end; ++child) body(child);
        },
        kChildrenOfRange);
  }

  [[nodiscard]] const Split& split(std::size_t child) const {
    return scene_.splits.splits[births_.split[child]];
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
    now_ = {.position = std::move(mapped.position),
            .along_x = std::move(mapped.cells.u),
            .along_y = std::move(mapped.cells.v)};
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
        now_.along_x[child].cross(now_.along_y[child]).norm() *
        rest_area(scene_.rest.u[own.sample], scene_.rest.v[own.sample], scene_.sampling.spacing[own.sample]) /
        static_cast<float>(own.major * own.minor);
    return kRadius * std::clamp(std::sqrt(area), kLeastLocal * wanted, kMostLocal * wanted);
  }

  // Positions of samples that were there before, then of children.
  [[nodiscard]] Vec3f place(std::uint32_t index) const {
    const std::size_t before = scene_.sampling.size();
    return index < before ? scene_.deformed[index] : now_.position[index - before];
  }

  void list_neighbors(std::size_t child) {
    const auto before = static_cast<std::uint32_t>(scene_.sampling.size());
    const Vec3f here = now_.position[child];
    const float reach = kListRadius * (radius_[child] = repulsion_radius(child));
    std::uint32_t* list = neighbors_.data() + child * kMostNeighbors;
    std::array<float, kMostNeighbors> distance{};
    std::uint32_t count = 0;
    const auto consider = [&](std::uint32_t index) {
      const float d = (place(index) - here).squaredNorm();
      if (d >= reach * reach || index == before + child) return;
      if (count < kMostNeighbors) {
        distance[count] = d;
        list[count++] = index;
        return;
      }
      // More than ever count: the nearest stay.
      const auto farthest = std::max_element(distance.begin(), distance.end());
      if (d >= *farthest) return;
      list[farthest - distance.begin()] = index;
      *farthest = d;
    };
    const auto consider_family = [&](std::uint32_t sample) {
      consider(sample);
      if (split_of_[sample] == kNone) return;
      const Split& family = scene_.splits.splits[split_of_[sample]];
      for (std::uint32_t c = 0; c < family.children(); ++c) consider(before + family.first_child + c);
    };
    const RestPatch& patch = scene_.patches.of(split(child).sample);
    consider_family(split(child).sample);
    for (std::uint32_t r = 0; r < patch.ring_size; ++r) consider_family(patch.ring[r]);
    count_[child] = count;
  }

  void move(std::size_t child) {
    moved_.set(child, now_.position[child]);
    const Vec3f ux = now_.along_x[child];
    const Vec3f uy = now_.along_y[child];
    const float a = ux.squaredNorm();
    const float b = ux.dot(uy);
    const float c = uy.squaredNorm();
    const float determinant = a * c - b * b;
    if (!(determinant > kLeastPlane * (a + c) * (a + c))) return;
    const Vec3f push = repulsion(child);
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
    moved_.set(child, now_.position[child] + gone);
  }

  [[nodiscard]] Vec3f repulsion(std::size_t child) const {
    const Vec3f here = now_.position[child];
    const float radius = radius_[child];
    Vec3f sum = Vec3f::Zero();
    float weight = 0.0F;
    const std::uint32_t* list = neighbors_.data() + child * kMostNeighbors;
    for (std::uint32_t n = 0; n < count_[child]; ++n) {
      const Vec3f away = here - place(list[n]);
      const float distance = away.norm();
      if (distance >= radius) continue;
      weight += 1.0F;
      if (distance > 0.0F) {
        sum += (1.0F - distance / radius) / distance * away;
      } else {
        // Born at the same place: one goes one way, the other the other way.
        const float side = list[n] < scene_.sampling.size() + child ? 1.0F : -1.0F;
        sum += side * now_.along_x[child].normalized();
      }
    }
    return kGain * radius / std::max(weight, kLeastWeight) * sum;
  }

  // Half a cell from the place of birth at most; beyond the parent's own half cell only toward neighbours.
  void confine(std::size_t child, float x, float y) {
    const Split& own = split(child);
    const float half = kMostWay * std::sqrt(rest_area(scene_.rest.u[own.sample], scene_.rest.v[own.sample],
                                                      scene_.sampling.spacing[own.sample]));
    float way_x = x - born_x_[child];
    float way_y = y - born_y_[child];
    const float way = std::sqrt(way_x * way_x + way_y * way_y);
    if (way > half) {
      way_x *= half / way;
      way_y *= half / way;
    }
    x = born_x_[child] + way_x;
    y = born_y_[child] + way_y;
    const float distance = std::sqrt(x * x + y * y);
    if (distance > half) {
      const RestPatch& patch = scene_.patches.of(own.sample);
      const Vec3f direction = x / distance * patch.u + y / distance * patch.v;
      const float born = std::sqrt(born_x_[child] * born_x_[child] + born_y_[child] * born_y_[child]);
      float reach = std::max(half, born);
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
  const std::vector<float> born_x_, born_y_;
  std::vector<std::uint32_t> split_of_;  // by sample
  Evaluated now_;
  std::vector<std::uint32_t> count_;  // by child
  std::vector<float> radius_;
  std::vector<std::uint32_t> neighbors_;
  Points moved_;
};

}  // namespace

void relax(const RelaxationScene& scene, std::uint32_t sweeps, Births& births,
           const ExecutionContext* context) {
  if (births.x.empty() || sweeps == 0) return;
  Relaxation(scene, births).run(sweeps, context);
}

}  // namespace pointwright

// What becomes of detail when the base is bent, stretched and spun: two bands over a plane and a sphere,
// against the same surfaces deformed exactly.
#include <doctest/doctest.h>

#include <cmath>
#include <string>

#include "engine/multires/shape_operator.h"
#include "engine/spatial/coherent_order.h"
#include "tests/editing/editing_support.h"
#include "tests/support/surfaces.h"

namespace pointwright {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kBorder = 0.5;  // the zero-region ends at x = -kBorder, the one-region begins at kBorder

struct Field {
  double t;
  Vec3d gradient;
};
Field field_at(const Vec3d& p) {
  if (p.x() <= -kBorder) return {0.0, Vec3d::Zero()};
  if (p.x() >= kBorder) return {1.0, Vec3d::Zero()};
  const double x = (kBorder - p.x()) / (2.0 * kBorder);
  return {(x * x - 1.0) * (x * x - 1.0), Vec3d(4.0 * x * (x * x - 1.0) / (-2.0 * kBorder), 0.0, 0.0)};
}

// A surface given by the nearest point of its base and the base's normal there.
struct Base {
  std::function<Vec3d(const Vec3d&)> project;
  std::function<Vec3d(const Vec3d&)> normal;
};

double coarse_detail(const Vec3d& p) {
  return 0.02 * std::sin(5.0 * p.x() + 0.3) * std::cos(4.0 * p.y()) * std::cos(3.0 * p.z());
}
double fine_detail(const Vec3d& p) {
  return 0.004 * std::sin(25.0 * p.x()) * std::cos(23.0 * p.y() + 0.5) * std::cos(21.0 * p.z());
}

// Levels 0, 1 and 2 of the surface after F, exactly, as functions of a point near the base.
class Exact {
 public:
  Exact(const Base& base, const Deformation& deformation) : base_(base), deformation_(deformation) {}

  [[nodiscard]] Vec3d level0(const Vec3d& q) const {
    const Vec3d p = base_.project(q);
    return deform_point(deformation_, p, field_at(p).t);
  }
  [[nodiscard]] Vec3d normal0(const Vec3d& q) const {
    return normal_of(q, 1e-5, [this](const Vec3d& x) { return level0(x); });
  }
  [[nodiscard]] Vec3d level1(const Vec3d& q) const {
    return level0(q) + coarse_detail(base_.project(q)) * normal0(q);
  }
  [[nodiscard]] Vec3d normal1(const Vec3d& q) const {
    return normal_of(q, 1e-4, [this](const Vec3d& x) { return level1(x); });
  }
  [[nodiscard]] Vec3d level2(const Vec3d& q) const {
    return level1(q) + fine_detail(base_.project(q)) * normal1(q);
  }
  [[nodiscard]] Vec3d normal2(const Vec3d& q) const {
    return normal_of(q, 1e-3, [this](const Vec3d& x) { return level2(x); });
  }

 private:
  template <typename Surface>
  [[nodiscard]] Vec3d normal_of(const Vec3d& q, double h, const Surface& surface) const {
    const Vec3d n = base_.normal(q);
    const Vec3d u = n.unitOrthogonal();
    const Vec3d v = n.cross(u);
    return (surface(q + h * u) - surface(q - h * u))
        .cross(surface(q + h * v) - surface(q - h * v))
        .normalized();
  }

  Base base_;
  Deformation deformation_;
};

struct Model {
  Base base;
  Points at;  // on the base, coherent
  MultiresSurface surface;
  NeighborGraph graph;
  ScaleField field;
};

Model model_of(const Base& base, const Points& scattered) {
  Model model{.base = base};
  const std::vector<std::uint32_t> order = coherent_order(scattered);
  const std::size_t n = order.size();
  model.at.resize(n);
  model.field = test::constant_field(n, 0.0F);
  model.surface.levels.assign(3, Level{.position = Points(n), .normal = Points(n)});
  model.surface.detail.assign(2, std::vector<float>(n));
  const Exact rest(base, Translation{});
  for (std::size_t i = 0; i < n; ++i) {
    model.at.set(i, scattered[order[i]]);
    const Vec3d q = model.at[i].cast<double>();
    auto& levels = model.surface.levels;
    levels[0].position.set(i, rest.level0(q).cast<float>());
    levels[0].normal.set(i, rest.normal0(q).cast<float>());
    levels[1].position.set(i, rest.level1(q).cast<float>());
    levels[1].normal.set(i, rest.normal1(q).cast<float>());
    levels[2].position.set(i, rest.level2(q).cast<float>());
    levels[2].normal.set(i, rest.normal2(q).cast<float>());
    model.surface.detail[0][i] = static_cast<float>(coarse_detail(base.project(q)));
    model.surface.detail[1][i] = static_cast<float>(fine_detail(base.project(q)));
    const Field at = field_at(base.project(q));
    model.field.t[i] = static_cast<float>(at.t);
    model.field.gradient.set(i, at.gradient.cast<float>());
  }
  model.graph = build_neighbor_graph(model.surface.finest().position, 10);
  return model;
}

const Model& plane() {
  static const Model model = model_of({.project = [](const Vec3d& q) { return Vec3d(q.x(), q.y(), 0.0); },
                                       .normal = [](const Vec3d&) -> Vec3d { return Vec3d::UnitZ(); }},
                                      test::plane(240, 2.0 / 239.0, test::Sampling::kJittered).position);
  return model;
}
const Model& sphere() {
  static const Model model = model_of({.project = [](const Vec3d& q) -> Vec3d { return q.normalized(); },
                                       .normal = [](const Vec3d& q) -> Vec3d { return q.normalized(); }},
                                      test::sphere(60'000, 1.0, test::Sampling::kRegular).position);
  return model;
}

struct Errors {
  double relative = 0.0;  // rms distance to the exact surface, of the rms fine detail
  std::size_t flipped = 0;
  std::size_t counted = 0;
};

// Samples near the border of an open base have one-sided neighbourhoods: `within` leaves them out.
Errors errors_of(const Model& model, const Deformation& deformation, std::uint32_t level, double within) {
  ScaleField field = model.field;
  const MultiresSurface after = apply_edit(
      model.surface, model.graph, {.level = level, .deformation = deformation}, field, Vec3d::Zero());
  const Exact exact(model.base, deformation);
  Errors errors;
  double squares = 0.0;
  double detail = 0.0;
  for (std::size_t i = 0; i < model.at.size(); i += 3) {
    const Vec3d q = model.at[i].cast<double>();
    if (field.t[i] <= 0.0F || std::max(std::abs(q.x()), std::abs(q.y())) > within) continue;
    squares += (after.finest().position[i].cast<double>() - exact.level2(q)).squaredNorm();
    detail += fine_detail(model.base.project(q)) * fine_detail(model.base.project(q));
    errors.flipped += after.levels[1].normal[i].cast<double>().dot(exact.normal1(q)) <= 0.0;
    ++errors.counted;
  }
  errors.relative = std::sqrt(squares / detail);
  return errors;
}

TEST_CASE("the field of these tests has the gradient that it says") {
  for (const double x : {-0.6, -0.3, 0.0, 0.2, 0.45, 0.7}) {
    const Vec3d p(x, 0.1, 0.2);
    const Vec3d h(1e-6, 0.0, 0.0);
    CHECK(field_at(p).gradient.x() ==
          doctest::Approx((field_at(p + h).t - field_at(p - h).t) / 2e-6).epsilon(1e-6));
  }
}

TEST_CASE("detail follows quarter turns and strong stretches of plane and sphere within 2 %") {
  // About axes at the models' edges: the map stretches up to six times, and folds nowhere.
  const Rotation bend{.point = Vec3d(0.0, 0.0, 1.0), .axis = Vec3d(0.0, -1.0, 0.0), .angle_rad = kPi / 2.0};
  const Rotation spin{.point = Vec3d(0.0, 1.0, 0.0), .axis = Vec3d(0.0, 0.0, 1.0), .angle_rad = kPi / 2.0};
  const Translation stretch{.vector = Vec3d(1.0, 0.0, 0.8)};
  struct Case {
    std::string name;
    Deformation deformation;
  };
  for (const Case& edit : {Case{"bend", bend}, Case{"spin", spin}, Case{"stretch", stretch}}) {
    const Errors on_plane = errors_of(plane(), edit.deformation, 0, 0.9);
    const Errors on_sphere = errors_of(sphere(), edit.deformation, 0, 2.0);
    MESSAGE(edit.name << ": plane " << on_plane.relative << ", sphere " << on_sphere.relative
                      << " of the rms detail");
    CHECK(on_plane.counted > 5000);
    CHECK(on_sphere.counted > 5000);
    CHECK(on_plane.relative < 0.02);
    CHECK(on_sphere.relative < 0.02);
    CHECK(on_plane.flipped + on_sphere.flipped == 0);
  }
}

TEST_CASE("one step of half a turn flips no normal") {
  for (const Vec3d& axis : {Vec3d(0.0, 0.0, 1.0), Vec3d(1.0, 0.0, 0.0)}) {
    const Rotation half{.point = Vec3d(0.0, 1.0, 0.0), .axis = axis, .angle_rad = kPi};
    const Errors on_plane = errors_of(plane(), half, 0, 0.9);
    const Errors on_sphere = errors_of(sphere(), half, 0, 2.0);
    MESSAGE("half a turn: plane " << on_plane.relative << ", sphere " << on_sphere.relative
                                  << " of the rms detail");
    CHECK(on_plane.flipped + on_sphere.flipped == 0);
    CHECK(on_plane.relative < 0.02);
    CHECK(on_sphere.relative < 0.02);
  }
}

TEST_CASE("single-resolution editing shears the detail where displacements leave the normal") {
  const Translation sideways{.vector = Vec3d(0.2, 0.0, 0.8)};  // steep: the base's normals turn by far
  const Errors single = errors_of(plane(), sideways, 2, 0.9);
  const Errors multires = errors_of(plane(), sideways, 0, 0.9);
  MESSAGE("of the rms detail: single resolution " << single.relative << ", multiresolution "
                                                  << multires.relative);
  CHECK(single.relative > 0.5);
  CHECK(multires.relative < 0.02);
}

TEST_CASE("shape operators of a sphere are its curvature, of a plane nothing") {
  const Level round = test::sphere_level(20'000, 2.0F);
  const NeighborGraph graph = build_neighbor_graph(round.position, 10);
  const ShapeOperators shape =
      shape_operators(round, NormalStencil(round, graph, NormalStencil::all_blocks(20'000)));
  float worst = 0.0F;
  for (std::size_t i = 0; i < 20'000; ++i) {
    worst =
        std::max({worst, std::abs(shape.uu[i] - 0.5F), std::abs(shape.vv[i] - 0.5F), std::abs(shape.uv[i])});
  }
  CHECK(worst < 5e-3F);
  const Level flat = test::plane_level(50);
  const NeighborGraph flat_graph = build_neighbor_graph(flat.position, 10);
  const ShapeOperators none =
      shape_operators(flat, NormalStencil(flat, flat_graph, NormalStencil::all_blocks(2500)));
  for (std::size_t i = 0; i < 2500; ++i) CHECK(none.uu[i] == 0.0F);
}

TEST_CASE("an offset along the normals of a sphere makes a larger sphere, and embosses where t varies") {
  const Level round = test::sphere_level(30'000, 1.0F);
  const MultiresSurface surface{.levels = {round}, .detail = {}};
  const NeighborGraph graph = build_neighbor_graph(round.position, 10);
  const MultiresSurface grown = apply_edit(surface, graph, {.deformation = NormalOffset{.distance = 0.5}},
                                           test::constant_field(30'000, 1.0F), Vec3d::Zero());
  for (std::size_t i = 0; i < 30'000; i += 7) {
    CHECK((grown.finest().position[i] - 1.5F * round.position[i]).norm() < 1e-6F);
    CHECK((grown.finest().normal[i] - round.normal[i]).norm() < 1e-5F);
  }
  // Where t varies the normals are those of the embossed surface (1 + 0.3 t(p)) p.
  ScaleField field = test::constant_field(30'000, 0.0F);
  for (std::size_t i = 0; i < 30'000; ++i) {
    const Field at = field_at(round.position[i].cast<double>());
    field.t[i] = static_cast<float>(at.t);
    field.gradient.set(i, at.gradient.cast<float>());
  }
  const MultiresSurface embossed =
      apply_edit(surface, graph, {.deformation = NormalOffset{.distance = 0.3}}, field, Vec3d::Zero());
  double worst = 0.0;
  for (std::size_t i = 0; i < 30'000; i += 7) {
    const Vec3d n = round.normal[i].cast<double>();
    const Vec3d u = n.unitOrthogonal();
    const Vec3d v = n.cross(u);
    const auto f = [&](const Vec3d& q) -> Vec3d {
      const Vec3d p = q.normalized();
      return (1.0 + 0.3 * field_at(p).t) * p;
    };
    const Vec3d expected =
        (f(n + 1e-5 * u) - f(n - 1e-5 * u)).cross(f(n + 1e-5 * v) - f(n - 1e-5 * v)).normalized();
    worst = std::max(worst, (embossed.finest().normal[i].cast<double>() - expected).norm());
  }
  CHECK(worst < 5e-3);  // of the regressed curvature
}

TEST_CASE("a band that is taken away leaves the normals of what is below, where detail was 0 too") {
  const Model& model = plane();
  const EditParams params{.deformation = Translation{}, .gains = {0.0F, 0.0F}};
  const MultiresSurface after = apply_edit(model.surface, model.graph, params,
                                           test::constant_field(model.at.size(), 1.0F), Vec3d::Zero());
  float worst = 0.0F;
  for (std::size_t i = 0; i < model.at.size(); ++i) {
    if (std::max(std::abs(model.at[i].x()), std::abs(model.at[i].y())) > 0.9F) continue;
    worst = std::max(worst, (after.finest().normal[i] - Vec3f::UnitZ()).norm());
  }
  CHECK(worst < 0.02F);
}

TEST_CASE("gains smooth, keep or exaggerate a band where t is 1, and leave the zero-region alone") {
  const Model& model = sphere();
  for (const float gain : {0.0F, 0.5F, 2.0F}) {
    const EditParams params{.deformation = Translation{}, .gains = {1.0F, gain}};
    const MultiresSurface after = apply_edit(model.surface, model.graph, params, model.field, Vec3d::Zero());
    std::size_t wrong = 0;
    for (std::size_t i = 0; i < model.at.size(); ++i) {
      const float d = model.surface.detail[1][i];
      const float expected = (1.0F + model.field.t[i] * (gain - 1.0F)) * d;
      wrong += std::abs(after.detail[1][i] - expected) > 1e-6F;
      const Vec3f base = after.levels[1].position[i] + after.detail[1][i] * after.levels[1].normal[i];
      wrong += (after.finest().position[i] - base).norm() > 2e-6F;
      if (model.field.t[i] == 0.0F)
        wrong += !test::same_sample(after.finest().position, model.surface.finest().position, i);
    }
    CHECK(wrong == 0);
    CHECK(after.detail[0] == model.surface.detail[0]);
  }
  CHECK(!validate(EditParams{.gains = {1.0F}}, model.surface).ok());
  CHECK(!validate(EditParams{.gains = {1.0F, 17.0F}}, model.surface).ok());
}

}  // namespace
}  // namespace pointwright

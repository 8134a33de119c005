#include "engine/editing/edit.h"

#include <doctest/doctest.h>

#include "engine/editing/edit_plan.h"
#include "tests/editing/editing_support.h"

namespace pointwright {
namespace {

constexpr double kPi = std::numbers::pi;

// Three levels with two bands of bumps over a sphere.
MultiresSurface bumpy_sphere(std::size_t n) {
  const Level base = test::sphere_level(n, 1.0F);
  MultiresSurface surface =
      test::one_band(base, [&](std::size_t i) { return 0.05F * std::sin(5.0F * base.position[i].x()); });
  surface.levels.push_back(surface.levels[1]);
  surface.detail.emplace_back(n);
  for (std::size_t i = 0; i < n; ++i) {
    const float d = 0.01F * std::cos(31.0F * base.position[i].y());
    surface.detail[1][i] = d;
    surface.levels[2].position.set(i, surface.levels[1].position[i] + d * surface.levels[1].normal[i]);
  }
  return surface;
}

RegionPair regions_beside(const Level& level, float border, float spacing) {
  return regions_from_marks(level.position, std::vector<float>(level.position.size(), spacing),
                            test::marks_beside(level.position, border), Vec3d::Zero())
      .value();
}

TEST_CASE("a zero deformation is the identity on every level, to the bit") {
  const MultiresSurface surface = bumpy_sphere(3001);
  for (std::uint32_t level = 0; level <= 2; ++level) {
    const RegionPair regions = regions_beside(surface.levels[level], 0.3F, 0.05F);
    const ScaleField field = compute_scale_field(surface.levels[level].position, regions, Blend::kQuartic);
    for (const Deformation& nothing :
         {Deformation(Translation{}),
          Deformation(Rotation{.axis = Vec3d(1.0, 1.0, 0.0), .angle_rad = 0.0})}) {
      const MultiresSurface after =
          test::edited(surface, {.level = level, .deformation = nothing}, field, Vec3d(5.0, 6.0, 7.0));
      CHECK(test::same_bytes(after, surface));
    }
  }
}

TEST_CASE("samples with t = 0 keep their bits on every level; coarser levels stay as they were") {
  const MultiresSurface surface = bumpy_sphere(5003);
  const EditParams rotation{.deformation = Rotation{.axis = Vec3d(0.3, 1.0, 0.0), .angle_rad = 1.2}};
  for (std::uint32_t level = 0; level <= 2; ++level) {
    EditParams params = rotation;
    params.level = level;
    const RegionPair regions = regions_beside(surface.levels[level], 0.3F, 0.05F);
    const ScaleField field = compute_scale_field(surface.levels[level].position, regions, Blend::kQuartic);
    const MultiresSurface after = test::edited(surface, params, field, Vec3d::Zero());
    std::size_t moved = 0;
    std::size_t wrong = 0;
    for (std::size_t i = 0; i < surface.sample_count(); ++i) {
      for (std::size_t k = 0; k <= 2; ++k) {
        const bool same = test::same_sample(after.levels[k].position, surface.levels[k].position, i) &&
                          test::same_sample(after.levels[k].normal, surface.levels[k].normal, i);
        if (field.t[i] == 0.0F || k < level) wrong += !same;
      }
      moved += field.t[i] > 0.0F && after.finest().position[i] != surface.finest().position[i];
    }
    CHECK(wrong == 0);
    CHECK(moved > 2000);
    CHECK(after.detail == surface.detail);
  }
}

TEST_CASE("a rigid motion of everything is reproduced to 1e-6 of the diagonal, normals included") {
  const MultiresSurface surface = bumpy_sphere(4000);
  const double diagonal = static_cast<double>(bounds_of(surface.finest().position).diagonal());
  const std::vector<Rotation> rotations = {
      {.point = Vec3d(0.2, -0.3, 0.4), .axis = Vec3d(1.0, 2.0, 3.0), .angle_rad = kPi},
      {.axis = Vec3d(0.0, 0.0, 1.0), .angle_rad = kPi / 2.0},
      {.point = Vec3d(1.0, 0.0, 0.0), .axis = Vec3d(-1.0, 0.1, 0.0), .angle_rad = 17.0}};
  const Vec3d origin(10.0, 20.0, -30.0);
  for (Rotation rotation : rotations) {
    rotation.point += origin;
    Rotation turn_only = rotation;
    turn_only.point = Vec3d::Zero();
    const MultiresSurface after =
        test::edited(surface, {.deformation = rotation}, test::constant_field(4000, 1.0F), origin);
    double position_error = 0.0;
    double normal_error = 0.0;
    for (std::size_t k = 0; k <= 2; ++k) {
      for (std::size_t i = 0; i < 4000; ++i) {
        const Vec3d expected =
            deform_point(rotation, origin + surface.levels[k].position[i].cast<double>(), 1.0) - origin;
        const Vec3d turned = deform_point(turn_only, surface.levels[k].normal[i].cast<double>(), 1.0);
        position_error =
            std::max(position_error, (after.levels[k].position[i].cast<double>() - expected).norm());
        normal_error = std::max(normal_error, (after.levels[k].normal[i].cast<double>() - turned).norm());
      }
    }
    CHECK(position_error < 1e-6 * diagonal);
    CHECK(normal_error < 1e-6);
  }
}

TEST_CASE("an edit followed by its inverse returns the rigid part within rounding") {
  const MultiresSurface surface = bumpy_sphere(4000);
  const RegionPair regions = regions_beside(surface.levels[0], 0.3F, 0.05F);
  const ScaleField field = compute_scale_field(surface.levels[0].position, regions, Blend::kQuartic);
  Rotation rotation{.point = Vec3d(0.3, 0.0, 0.0), .axis = Vec3d(0.0, 1.0, 0.2), .angle_rad = 2.0};
  const MultiresSurface there = test::edited(surface, {.deformation = rotation}, field, Vec3d::Zero());
  rotation.angle_rad = -2.0;
  const MultiresSurface back = test::edited(there, {.deformation = rotation}, field, Vec3d::Zero());
  float error = 0.0F;
  for (std::size_t i = 0; i < 4000; ++i) {
    if (field.t[i] != 1.0F && field.t[i] != 0.0F) continue;
    if (field.gradient[i] != Vec3f::Zero()) continue;
    error = std::max(error, (back.finest().position[i] - surface.finest().position[i]).norm());
    error = std::max(error, (back.finest().normal[i] - surface.finest().normal[i]).norm());
  }
  CHECK(error < 2e-6F);
}

// The largest angle between the normals of the edited level and numeric normals of the deformed surface.
struct NormalCheck {
  std::size_t compared = 0;
  double worst = 0.0;
};
NormalCheck compare_normals(const Level& base, const RegionPair& regions, const Deformation& deformation,
                            const std::function<Vec3d(const Vec3d&)>& project) {
  const ScaleField field = compute_scale_field(base.position, regions, Blend::kQuartic);
  const MultiresSurface surface{.levels = {base}, .detail = {}};
  const MultiresSurface after = test::edited(surface, {.deformation = deformation}, field, Vec3d::Zero());
  NormalCheck check;
  for (std::size_t i = 7; i < base.position.size(); i += 23) {
    if (field.t[i] <= 0.0F) continue;
    const Vec3d p = base.position[i].cast<double>();
    const Vec3d n = base.normal[i].cast<double>();
    const Vec3d wide = test::reference_normal(regions, deformation, p, n, 1e-4, project);
    const Vec3d narrow = test::reference_normal(regions, deformation, p, n, 2e-5, project);
    if ((wide - narrow).norm() > 1e-3) continue;  // on a medial line, where t has a crease
    ++check.compared;
    check.worst = std::max(check.worst, (narrow - after.finest().normal[i].cast<double>()).norm());
  }
  return check;
}

TEST_CASE("normals of the edited level are those of the deformed surface") {
  const std::vector<Deformation> deformations = {
      Translation{.vector = Vec3d(0.1, 0.2, 0.8)},
      Rotation{.axis = Vec3d(0.0, -1.0, 0.0), .angle_rad = kPi / 2.0},
      Rotation{.axis = Vec3d(0.2, 0.1, 1.0), .angle_rad = kPi}};
  const Level plane = test::plane_level(51);
  const RegionPair plane_pair = regions_beside(plane, 0.4F, 0.04F);
  const Level sphere = test::sphere_level(2500, 1.0F);
  const RegionPair sphere_pair = regions_beside(sphere, 0.4F, 0.07F);
  for (const Deformation& deformation : deformations) {
    const NormalCheck on_plane =
        compare_normals(plane, plane_pair, deformation, [](const Vec3d& q) { return q; });
    CHECK(on_plane.compared > 40);
    CHECK(on_plane.worst < 1e-3);
    const NormalCheck on_sphere = compare_normals(sphere, sphere_pair, deformation,
                                                  [](const Vec3d& q) -> Vec3d { return q.normalized(); });
    CHECK(on_sphere.compared > 40);
    CHECK(on_sphere.worst < 1e-3);
  }
}

TEST_CASE("detail on a bent plane ends where p' = r' + d n' says") {
  const Level plane = test::plane_level(61);
  const MultiresSurface surface = test::one_band(plane, [&](std::size_t i) {
    return 0.05F * std::sin(13.0F * plane.position[i].x()) * std::cos(11.0F * plane.position[i].y());
  });
  const RegionPair regions = regions_beside(plane, 0.4F, 0.03F);
  const ScaleField field = compute_scale_field(plane.position, regions, Blend::kQuartic);
  const Rotation bend{.axis = Vec3d(0.0, -1.0, 0.0), .angle_rad = kPi / 2.0};
  const MultiresSurface after = test::edited(surface, {.deformation = bend}, field, Vec3d::Zero());
  double error_sq = 0.0;
  double detail_sq = 0.0;
  std::size_t counted = 0;
  for (std::size_t i = 0; i < plane.position.size(); i += 11) {
    if (field.t[i] <= 0.0F) continue;
    const Vec3d r = plane.position[i].cast<double>();
    const Vec3d n =
        test::reference_normal(regions, bend, r, Vec3d::UnitZ(), 1e-5, [](const Vec3d& q) { return q; });
    const Vec3d expected =
        deform_point(bend, r, test::reference_t(regions, r)) + double{surface.detail[0][i]} * n;
    error_sq += (after.finest().position[i].cast<double>() - expected).squaredNorm();
    detail_sq += double{surface.detail[0][i]} * double{surface.detail[0][i]};
    ++counted;
  }
  CHECK(counted > 100);
  CHECK(std::sqrt(error_sq / detail_sq) < 0.02);
}

TEST_CASE("single-resolution editing deforms the finest level alone") {
  const MultiresSurface surface = bumpy_sphere(1000);
  const RegionPair regions = regions_beside(surface.levels[2], 0.3F, 0.07F);
  const ScaleField field = compute_scale_field(surface.levels[2].position, regions, Blend::kQuartic);
  const Translation translation{.vector = Vec3d(0.0, 0.0, 0.5)};
  const MultiresSurface after =
      test::edited(surface, {.level = 2, .deformation = translation}, field, Vec3d::Zero());
  Level alone;
  deform(translation, Vec3d::Zero(), field, surface.levels[2], alone);
  CHECK(test::same_bytes(after.finest().position, alone.position));
  CHECK(test::same_bytes(after.finest().normal, alone.normal));
}

TEST_CASE("parameters are validated against the surface") {
  const MultiresSurface surface = bumpy_sphere(100);
  CHECK(validate(EditParams{.level = 2}, surface).ok());
  const Result<void> level = validate(EditParams{.level = 3}, surface);
  REQUIRE(!level.ok());
  CHECK(level.error().code == ErrorCode::kInvalidArgument);
  CHECK(level.error().field == "level");
  CHECK(level.error().limit == 2.0);
  const Result<void> axis = validate(EditParams{.deformation = Rotation{.axis = Vec3d::Zero()}}, surface);
  REQUIRE(!axis.ok());
  CHECK(axis.error().field == "deformation.axis");
}

TEST_CASE("frames of one plan write over each other and come out as if made alone") {
  const MultiresSurface surface = bumpy_sphere(2100);
  const NeighborGraph graph = build_neighbor_graph(surface.finest().position, 10);
  const RegionPair regions = regions_beside(surface.levels[1], 0.3F, 0.05F);
  const ScaleField field = compute_scale_field(surface.levels[1].position, regions, Blend::kQuartic);
  const std::vector<EditParams> drag = {
      {.level = 1, .deformation = Rotation{.angle_rad = 1.0}},
      {.level = 1, .deformation = Translation{.vector = Vec3d(0.1, 0.0, 0.3)}},
      {.level = 1, .deformation = Translation{}},
      {.level = 1, .deformation = Scaling{.factors = Vec3d(1.0, 2.0, 0.5)}},
      {.level = 1, .deformation = NormalOffset{.distance = 0.05}},
      {.level = 1, .deformation = Translation{}, .gains = {1.0F, 0.0F}}};
  const EditPlan rigid(surface, graph, drag[0], field);
  const EditPlan bending(surface, graph, {.level = 1, .deformation = NormalOffset{}}, field);
  CHECK(rigid.rigid().size() + rigid.bending().size() == rigid.moving().size());
  CHECK(bending.rigid().empty());
  MultiresSurface reused_rigid = surface;
  MultiresSurface reused_bending = surface;
  for (const EditParams& params : drag) {
    REQUIRE(rigid.serves(params) != bending.serves(params));
    const EditPlan& plan = rigid.serves(params) ? rigid : bending;
    MultiresSurface& reused = rigid.serves(params) ? reused_rigid : reused_bending;
    apply_edit(surface, plan, params, field, Vec3d::Zero(), reused);
    CHECK(test::same_bytes(reused, test::edited(surface, params, field, Vec3d::Zero())));
  }
  CHECK(rigid.serves(drag[2]));
  CHECK_FALSE(rigid.serves({.level = 0}));
  MultiresSurface itself = surface;
  CHECK_THROWS_AS(apply_edit(itself, rigid, drag[0], field, Vec3d::Zero(), itself), LogicError);
  MultiresSurface smaller = bumpy_sphere(30);
  CHECK_THROWS_AS(apply_edit(surface, rigid, drag[0], field, Vec3d::Zero(), smaller), LogicError);
}

TEST_CASE("an edit gives the same bytes for any thread count, instruction set and number of samples") {
  const MultiresSurface surface = bumpy_sphere(6007);
  const RegionPair regions = regions_beside(surface.levels[0], 0.3F, 0.05F);
  const ScaleField field = compute_scale_field(surface.levels[0].position, regions, Blend::kQuartic);
  const EditParams params{.deformation = Rotation{.axis = Vec3d(1.0, 2.0, 3.0), .angle_rad = 4.0}};
  test::for_all_machines(
      [&] { return test::edited(surface, params, field, Vec3d::Zero()); },
      [](const MultiresSurface& a, const MultiresSurface& b) { CHECK(test::same_bytes(a, b)); });

  const MultiresSurface all = test::edited(surface, params, field, Vec3d::Zero());
  for (const std::size_t n : {0, 1, 15, 16, 17}) {
    MultiresSurface some = surface;
    ScaleField some_field = field;
    for (Level& level : some.levels) {
      level.position.resize(n);
      level.normal.resize(n);
    }
    for (auto& column : some.detail) column.resize(n);
    some_field.t.resize(padded_to_block(n));
    some_field.gradient.resize(n);
    const MultiresSurface after = test::edited(some, params, some_field, Vec3d::Zero());
    REQUIRE(after.sample_count() == n);
    // Finer normals look at neighbours, which are others among fewer samples.
    for (std::size_t i = 0; i < n; ++i) {
      CHECK(test::same_sample(after.levels[0].position, all.levels[0].position, i));
      CHECK(test::same_sample(after.levels[0].normal, all.levels[0].normal, i));
      CHECK(test::same_sample(after.levels[1].position, all.levels[1].position, i));
    }
    for (const Level& level : after.levels) {
      CHECK(test::all_finite(level.position));
      CHECK(test::all_finite(level.normal));
    }
  }
}

}  // namespace
}  // namespace pointwright

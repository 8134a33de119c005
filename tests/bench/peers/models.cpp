#include "tests/bench/peers/models.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "tests/bench/synthetic_scan.h"
#include "tests/support/surfaces.h"

namespace pointwright::peers {
namespace {

constexpr double kTwoPi = 2.0 * std::numbers::pi;

Vec3d shaken(const Vec3d& p, double noise, test::Random& random) {
  if (noise == 0.0) return p;
  return p + noise * Vec3d(random.normal(), random.normal(), random.normal());
}

// Two triangles for each cell of a lattice of rows x columns vertices that closes along its columns.
void add_cells(TriangleMesh& mesh, std::uint32_t first, std::uint32_t rows, std::uint32_t columns,
               bool rows_close) {
  for (std::uint32_t row = 0; row + (rows_close ? 0U : 1U) < rows; ++row) {
    for (std::uint32_t column = 0; column < columns; ++column) {
      const auto at = [&](std::uint32_t i, std::uint32_t j) {
        return first + i % rows * columns + j % columns;
      };
      mesh.triangle.push_back({at(row, column), at(row, column + 1), at(row + 1, column + 1)});
      mesh.triangle.push_back({at(row, column), at(row + 1, column + 1), at(row + 1, column)});
    }
  }
}

std::uint32_t rounded(double x) {
  return static_cast<std::uint32_t>(std::lround(x));
}

// Half sides and upper levels of the slabs; the lowest stands on z = 0.
struct Slab {
  double half;
  double low;
  double high;
};
constexpr std::array<Slab, 3> kSlabs{{{1.0, 0.0, 0.5}, {0.6, 0.5, 0.9}, {0.25, 0.9, 1.2}}};

// An axis-aligned rectangle: a box of no thickness along one axis.
struct Face {
  Vec3d low;
  Vec3d high;

  [[nodiscard]] double area() const {
    const Vec3d extent = high - low;
    return extent.x() * extent.y() + extent.y() * extent.z() + extent.z() * extent.x();
  }
};

std::vector<Face> step_faces() {
  std::vector<Face> faces;
  const double widest = kSlabs.front().half;
  faces.push_back({{-widest, -widest, 0.0}, {widest, widest, 0.0}});
  for (std::size_t s = 0; s < kSlabs.size(); ++s) {
    const auto& [half, low, high] = kSlabs[s];
    for (const double side : {-half, half}) {
      faces.push_back({{side, -half, low}, {side, half, high}});
      faces.push_back({{-half, side, low}, {half, side, high}});
    }
    const double inner = s + 1 < kSlabs.size() ? kSlabs[s + 1].half : 0.0;
    faces.push_back({{-half, -half, high}, {half, -inner, high}});
    faces.push_back({{-half, inner, high}, {half, half, high}});
    if (inner == 0.0) continue;  // the uppermost has no hole
    faces.push_back({{-half, -inner, high}, {-inner, inner, high}});
    faces.push_back({{inner, -inner, high}, {half, inner, high}});
  }
  return faces;
}

// The slabs' profile from the middle of the bottom to the middle of the top: half side and height.
std::vector<std::array<double, 2>> step_profile() {
  std::vector<std::array<double, 2>> profile{{0.0, 0.0}};
  for (const auto& [half, low, high] : kSlabs) {
    profile.push_back({half, low});
    profile.push_back({half, high});
  }
  profile.push_back({0.0, kSlabs.back().high});
  return profile;
}

// A place along the border of the unit square [-1, 1]^2, from (1, -1) anticlockwise; `turn` in [0, 4).
std::array<double, 2> on_square(double turn) {
  const double along = 2.0 * (turn - std::floor(turn)) - 1.0;
  switch (static_cast<int>(turn) % 4) {
    case 0:
      return {1.0, along};
    case 1:
      return {-along, 1.0};
    case 2:
      return {-1.0, -along};
    default:
      return {along, -1.0};
  }
}

// The profile swept around the square: rows along the profile, columns around it, a vertex at either pole.
TriangleMesh steps_mesh(std::size_t vertices) {
  const auto profile = step_profile();
  double length = 0.0;
  for (std::size_t i = 1; i < profile.size(); ++i) {
    length += std::hypot(profile[i][0] - profile[i - 1][0], profile[i][1] - profile[i - 1][1]);
  }
  const double around = 8.0 * kSlabs.front().half;
  const double spacing = std::sqrt(length * around / static_cast<double>(vertices));
  const std::uint32_t rows = rounded(length / spacing);
  const std::uint32_t columns = rounded(around / spacing);
  TriangleMesh mesh;
  std::size_t leg = 1;
  double passed = 0.0;
  for (std::uint32_t row = 0; row < rows; ++row) {
    // Off the corners by no simple fraction, so that neither rows nor columns meet an edge.
    const double s = (row + 0.37) * length / rows;
    for (;; ++leg) {
      const double here =
          std::hypot(profile[leg][0] - profile[leg - 1][0], profile[leg][1] - profile[leg - 1][1]);
      if (s <= passed + here || leg + 1 == profile.size()) {
        const double t = (s - passed) / here;
        const double half = (1.0 - t) * profile[leg - 1][0] + t * profile[leg][0];
        const double z = (1.0 - t) * profile[leg - 1][1] + t * profile[leg][1];
        for (std::uint32_t column = 0; column < columns; ++column) {
          const auto [x, y] = on_square((column + 0.41) * 4.0 / columns);
          mesh.vertex.emplace_back(half * x, half * y, z);
        }
        break;
      }
      passed += here;
    }
  }
  add_cells(mesh, 0, rows, columns, false);
  const auto bottom = static_cast<std::uint32_t>(mesh.vertex.size());
  mesh.vertex.emplace_back(0.0, 0.0, 0.0);
  mesh.vertex.emplace_back(0.0, 0.0, kSlabs.back().high);
  const std::uint32_t last = (rows - 1) * columns;
  for (std::uint32_t column = 0; column < columns; ++column) {
    const std::uint32_t next = (column + 1) % columns;
    mesh.triangle.push_back({bottom, next, column});
    mesh.triangle.push_back({bottom + 1, last + column, last + next});
  }
  return mesh;
}

struct Foot {
  Vec3d point;
  Vec3d du;  // tangents
  Vec3d dv;
};

// Gauss-Newton from the angles of the point itself; a step that leads away is halved.
Foot foot_on_scan(const Vec3d& p) {
  double u = std::atan2(p.y(), p.x());
  double v = std::atan2(p.z(), std::hypot(p.x(), p.y()) - 1.0);
  Foot foot;
  foot.point = bench::scan_surface(u, v);
  for (int iteration = 0; iteration < 40; ++iteration) {
    constexpr double kDelta = 1e-5;  // central differences: off by 1e-7 of the tangents, which moves no foot
    const Vec3d away = p - foot.point;
    foot.du = (bench::scan_surface(u + kDelta, v) - bench::scan_surface(u - kDelta, v)) / (2 * kDelta);
    foot.dv = (bench::scan_surface(u, v + kDelta) - bench::scan_surface(u, v - kDelta)) / (2 * kDelta);
    const double uu = foot.du.squaredNorm();
    const double uv = foot.du.dot(foot.dv);
    const double vv = foot.dv.squaredNorm();
    const double determinant = uu * vv - uv * uv;
    double step_u = (vv * foot.du.dot(away) - uv * foot.dv.dot(away)) / determinant;
    double step_v = (uu * foot.dv.dot(away) - uv * foot.du.dot(away)) / determinant;
    bool nearer = false;
    for (int halving = 0; halving < 12 && !nearer; ++halving) {
      const Vec3d next = bench::scan_surface(u + step_u, v + step_v);
      nearer = (p - next).squaredNorm() < away.squaredNorm();
      if (nearer) {
        u += step_u;
        v += step_v;
        foot.point = next;
      }
      step_u *= 0.5;
      step_v *= 0.5;
    }
    if (!nearer || std::abs(step_u) + std::abs(step_v) < 1e-9) break;
  }
  return foot;
}

}  // namespace

Model scan_model(std::size_t samples, double noise) {
  test::Random random(7);
  Model model;
  model.name = noise == 0.0 ? "scan" : "noisy";
  model.samples = bench::synthetic_scan(samples).position;
  for (std::size_t i = 0; noise != 0.0 && i < samples; ++i) {
    model.samples.set(i, shaken(model.samples[i].cast<double>(), noise, random).cast<float>());
  }
  model.distance = distance_to_scan;
  // As many columns as keep cells square: circumferences of radius 1 and 0.4.
  const std::uint32_t rows = rounded(std::sqrt(2.5 * static_cast<double>(samples)));
  const std::uint32_t columns = rounded(static_cast<double>(samples) / rows);
  for (std::uint32_t row = 0; row < rows; ++row) {
    for (std::uint32_t column = 0; column < columns; ++column) {
      const Vec3d p = bench::scan_surface(kTwoPi * row / rows, kTwoPi * column / columns);
      model.mesh.vertex.push_back(shaken(p, noise, random));
    }
  }
  add_cells(model.mesh, 0, rows, columns, true);
  return model;
}

// Decimation of a mesh by quadrics takes minutes on more: flats cost nothing, and nothing orders them.
constexpr std::size_t kMostFlatVertices = 40'000;

Model steps_model(std::size_t samples) {
  test::Random random(11);
  const std::vector<Face> faces = step_faces();
  double total = 0.0;
  for (const Face& face : faces) total += face.area();
  Points points(samples);
  for (std::size_t i = 0; i < samples; ++i) {
    double at = total * random.uniform();
    std::size_t f = 0;
    while (f + 1 < faces.size() && at >= faces[f].area()) at -= faces[f++].area();
    Vec3d p;
    for (int axis = 0; axis < 3; ++axis) p[axis] = random.uniform(faces[f].low[axis], faces[f].high[axis]);
    points.set(i, p.cast<float>());
  }
  Model model;
  model.name = "steps";
  model.samples = points;
  model.distance = distance_to_steps;
  model.mesh = steps_mesh(std::min<std::size_t>(samples, kMostFlatVertices));
  return model;
}

double distance_to_scan(const Vec3d& p) {
  return (p - foot_on_scan(p).point).norm();
}

Vec3f scan_normal(const Vec3d& p) {
  const Foot foot = foot_on_scan(p);
  return foot.du.cross(foot.dv).normalized().cast<float>();
}

double distance_to_steps(const Vec3d& p) {
  static const std::vector<Face> faces = step_faces();
  double nearest = std::numeric_limits<double>::infinity();
  for (const Face& face : faces) {
    nearest = std::min(nearest, (p - p.cwiseMax(face.low).cwiseMin(face.high)).squaredNorm());
  }
  return std::sqrt(nearest);
}

}  // namespace pointwright::peers

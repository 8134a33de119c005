#include "tests/support/surfaces.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <numeric>

#include "engine/core/check.h"
#include "engine/spatial/coherent_order.h"

namespace pointwright::test {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kGoldenAngle = 2.399963229728653;  // pi (3 - sqrt 5)

void add(Surface& surface, std::size_t i, const Vec3d& p, const Vec3d& n) {
  surface.position.set(i, p.cast<float>());
  surface.normal.set(i, n.normalized().cast<float>());
}

Surface empty_surface(std::size_t count) {
  return {Points(count), Points(count)};
}

Vec3d fibonacci_direction(std::size_t i, std::size_t count) {
  const double z = 1.0 - (2.0 * static_cast<double>(i) + 1.0) / static_cast<double>(count);
  const double ring = std::sqrt(std::max(0.0, 1.0 - z * z));
  const double turn = kGoldenAngle * static_cast<double>(i);
  return {ring * std::cos(turn), ring * std::sin(turn), z};
}

// Where the samples of a square patch of side x side lattice cells stand in its plane, centred.
std::vector<std::array<double, 2>> patch(std::size_t side, double spacing, Sampling sampling,
                                         std::uint64_t seed) {
  Random random(seed);
  std::vector<std::array<double, 2>> result;
  result.reserve(side * side);
  const double middle = 0.5 * static_cast<double>(side);
  for (std::size_t row = 0; row < side; ++row) {
    for (std::size_t column = 0; column < side; ++column) {
      double x = static_cast<double>(column) + 0.5;
      double y = static_cast<double>(row) + 0.5;
      if (sampling == Sampling::kJittered) {
        x += random.uniform(-0.3, 0.3);
        y += random.uniform(-0.3, 0.3);
      } else if (sampling == Sampling::kRandom) {
        x = random.uniform(0.0, static_cast<double>(side));
        y = random.uniform(0.0, static_cast<double>(side));
      }
      result.push_back({(x - middle) * spacing, (y - middle) * spacing});
    }
  }
  return result;
}

}  // namespace

std::uint64_t Random::bits() {
  state_ += 0x9e3779b97f4a7c15ULL;
  std::uint64_t z = state_;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ULL;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebULL;
  return z ^ (z >> 31);
}

double Random::uniform() {
  return static_cast<double>(bits() >> 11) * 0x1.0p-53;
}

double Random::uniform(double low, double high) {
  return low + (high - low) * uniform();
}

double Random::normal() {
  const double radius = std::sqrt(-2.0 * std::log(1.0 - uniform()));
  return radius * std::cos(2.0 * kPi * uniform());
}

std::size_t Random::below(std::size_t count) {
  return static_cast<std::size_t>(uniform() * static_cast<double>(count));
}

Vec3d Random::direction() {
  const double z = uniform(-1.0, 1.0);
  const double turn = uniform(0.0, 2.0 * kPi);
  const double ring = std::sqrt(1.0 - z * z);
  return {ring * std::cos(turn), ring * std::sin(turn), z};
}

Surface plane(std::size_t side, double spacing, Sampling sampling, std::uint64_t seed) {
  return wave(side, spacing, sampling, 0.0, 1.0, seed);
}

Surface wave(std::size_t side, double spacing, Sampling sampling, double amplitude, double wavelength,
             std::uint64_t seed) {
  const auto where = patch(side, spacing, sampling, seed);
  Surface result = empty_surface(where.size());
  const double frequency = 2.0 * kPi / wavelength;
  for (std::size_t i = 0; i < where.size(); ++i) {
    const double phase = frequency * where[i][0];
    const double slope = amplitude == 0.0 ? 0.0 : amplitude * frequency * std::cos(phase);
    add(result, i, {where[i][0], where[i][1], amplitude == 0.0 ? 0.0 : amplitude * std::sin(phase)},
        {-slope, 0.0, 1.0});
  }
  return coherent(result);
}

Surface parallel_sheets(std::size_t side, double spacing, double gap, Sampling sampling, std::uint64_t seed) {
  Surface upper = moved(plane(side, spacing, sampling, seed), {0.0, 0.0, 0.5 * gap});
  Surface lower = moved(plane(side, spacing, sampling, seed + 1), {0.0, 0.0, -0.5 * gap});
  for (std::size_t i = 0; i < lower.size(); ++i) lower.normal.set(i, -lower.normal[i]);
  return joined({upper, lower});
}

Surface sphere(std::size_t count, double radius, Sampling sampling, std::uint64_t seed) {
  POINTWRIGHT_CHECK(sampling != Sampling::kJittered, "spheres are regular or random");
  Random random(seed);
  Surface result = empty_surface(count);
  for (std::size_t i = 0; i < count; ++i) {
    const Vec3d n = sampling == Sampling::kRandom ? random.direction() : fibonacci_direction(i, count);
    add(result, i, radius * n, n);
  }
  return coherent(result);
}

Surface hemisphere(std::size_t count, double radius) {
  Surface result = empty_surface(count);
  for (std::size_t i = 0; i < count; ++i) {  // the lattice runs from the pole z = 1 down
    const Vec3d n = fibonacci_direction(i, 2 * count);
    add(result, i, radius * n, n);
  }
  return coherent(result);
}

Surface ellipsoid(std::size_t count, const Vec3d& half_axes) {
  Surface result = empty_surface(count);
  for (std::size_t i = 0; i < count; ++i) {
    const Vec3d n = fibonacci_direction(i, count);
    add(result, i, n.cwiseProduct(half_axes), n.cwiseQuotient(half_axes));
  }
  return coherent(result);
}

Surface torus(std::size_t count, double major, double minor, Sampling sampling, std::uint64_t seed) {
  POINTWRIGHT_CHECK(sampling != Sampling::kJittered, "tori are regular or random");
  constexpr double kPlastic = 1.32471795724474602596;  // its powers make an evenly spread lattice
  Random random(seed);
  Surface result = empty_surface(count);
  for (std::size_t i = 0; i < count; ++i) {
    const double at = static_cast<double>(i) + 1.0;
    const bool is_random = sampling == Sampling::kRandom;
    const double a = is_random ? random.uniform() : std::fmod(at / kPlastic, 1.0);
    const double b = is_random ? random.uniform() : std::fmod(at / (kPlastic * kPlastic), 1.0);
    const double u = 2.0 * kPi * a;
    double v = 2.0 * kPi * b;  // area grows as major + minor cos v: invert its integral
    for (int newton = 0; newton < 20; ++newton) {
      v -= (major * v + minor * std::sin(v) - 2.0 * kPi * b * major) / (major + minor * std::cos(v));
    }
    const Vec3d n{std::cos(v) * std::cos(u), std::cos(v) * std::sin(u), std::sin(v)};
    add(result, i, Vec3d(major * std::cos(u), major * std::sin(u), 0.0) + minor * n, n);
  }
  return coherent(result);
}

Surface cube(std::size_t side, double half, std::uint64_t seed) {
  Surface result = empty_surface(6 * side * side);
  std::size_t i = 0;
  for (int face = 0; face < 6; ++face) {
    const double sign = face % 2 == 0 ? 1.0 : -1.0;
    const int axis = face / 2;
    const double spacing = 2.0 * half / static_cast<double>(side);
    for (const auto& at :
         patch(side, spacing, Sampling::kJittered, seed + static_cast<std::uint64_t>(face))) {
      Vec3d p;
      Vec3d n = Vec3d::Zero();
      p[axis] = sign * half;
      n[axis] = sign;
      p[(axis + 1) % 3] = at[0];
      p[(axis + 2) % 3] = at[1];
      add(result, i++, p, n);
    }
  }
  return coherent(result);
}

double Bumps::spacing() const {
  return std::sqrt(4.0 * kPi / static_cast<double>(count));
}

Surface bumpy_sphere(std::size_t count, const Bumps& bumps) {
  std::vector<Vec3d> centers(bumps.count);
  for (std::size_t c = 0; c < bumps.count; ++c) centers[c] = fibonacci_direction(c, bumps.count);
  const double reach = 7.0 * bumps.width;  // the rest of a bump is below 1e-10 of its height
  Surface result = empty_surface(count);
  for (std::size_t i = 0; i < count; ++i) {
    const Vec3d direction = fibonacci_direction(i, count);
    double height = 0.0;
    Vec3d gradient = Vec3d::Zero();
    for (const Vec3d& center : centers) {  // ordered by descending z
      if (center.z() > direction.z() + reach) continue;
      if (center.z() < direction.z() - reach) break;
      const Vec3d e = direction - center;
      const double bump = bumps.height * std::exp(-0.5 * e.squaredNorm() / (bumps.width * bumps.width));
      height += bump;
      gradient -= bump / (bumps.width * bumps.width) * e;
    }
    gradient -= gradient.dot(direction) * direction;
    const double radius = 1.0 + height;
    add(result, i, radius * direction, radius * direction - gradient);
  }
  return coherent(result);
}

Surface displaced(const Surface& surface, const std::function<double(const Vec3d&)>& height) {
  Surface result = surface;
  for (std::size_t i = 0; i < surface.size(); ++i) {
    const Vec3d p = surface.position[i].cast<double>();
    result.position.set(i, (p + height(p) * surface.normal[i].cast<double>()).cast<float>());
  }
  return coherent(result);
}

Surface with_noise(const Surface& surface, double sigma, std::uint64_t seed) {
  Random random(seed);
  Surface result = surface;
  for (std::size_t i = 0; i < surface.size(); ++i) {
    const Vec3d noise = sigma * Vec3d(random.normal(), random.normal(), random.normal());
    result.position.set(i, (surface.position[i].cast<double>() + noise).cast<float>());
  }
  return coherent(result);
}

Surface moved(const Surface& surface, const Vec3d& offset) {
  Surface result = surface;
  for (std::size_t i = 0; i < surface.size(); ++i) {
    result.position.set(i, (surface.position[i].cast<double>() + offset).cast<float>());
  }
  return coherent(result);
}

Surface joined(const std::vector<Surface>& parts) {
  std::size_t count = 0;
  for (const Surface& part : parts) count += part.size();
  Surface result = empty_surface(count);
  std::size_t at = 0;
  for (const Surface& part : parts) {
    for (std::size_t i = 0; i < part.size(); ++i, ++at) {
      result.position.set(at, part.position[i]);
      result.normal.set(at, part.normal[i]);
    }
  }
  return coherent(result);
}

Surface coherent(const Surface& surface) {
  const auto order = coherent_order(surface.position);
  return {reordered(surface.position, order), reordered(surface.normal, order)};
}

Points identical(std::size_t count, const Vec3f& where) {
  Points result(count);
  for (std::size_t i = 0; i < count; ++i) result.set(i, where);
  return result;
}

Points collinear(std::size_t count, const Vec3f& from, const Vec3f& to) {
  Points result(count);
  for (std::size_t i = 0; i < count; ++i) {
    const float at = count < 2 ? 0.0F : static_cast<float>(i) / static_cast<float>(count - 1);
    result.set(i, from + at * (to - from));
  }
  return coherent(result);
}

Points from_list(const std::vector<Vec3f>& list) {
  Points result(list.size());
  for (std::size_t i = 0; i < list.size(); ++i) result.set(i, list[i]);
  return coherent(result);
}

Points coherent(const Points& points) {
  return reordered(points, coherent_order(points));
}

Points reordered(const Points& points, const std::vector<std::uint32_t>& order) {
  Points result(order.size());
  for (std::size_t i = 0; i < order.size(); ++i) result.set(i, points[order[i]]);
  return result;
}

Cloud to_cloud(const Points& position) {
  Cloud cloud;
  cloud.position = position;
  cloud.id.resize(position.size());
  std::iota(cloud.id.begin(), cloud.id.end(), 0U);
  return cloud;
}

Cloud to_cloud(const Surface& surface) {
  Cloud cloud = to_cloud(surface.position);
  cloud.normal = surface.normal;
  return cloud;
}

Points scrambled_signs(const Points& normal, std::uint64_t seed) {
  Random random(seed);
  Points result = normal;
  for (std::size_t i = 0; i < normal.size(); ++i) {
    if (random.uniform() < 0.5) result.set(i, -normal[i]);
  }
  return result;
}

double line_angle(const Vec3f& a, const Vec3f& b) {
  const Vec3d u = a.cast<double>();
  const Vec3d v = b.cast<double>();
  return std::atan2(u.cross(v).norm(), std::abs(u.dot(v)));
}

double mean_line_angle(const Points& a, const Points& b) {
  double sum = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += line_angle(a[i], b[i]);
  return sum / static_cast<double>(a.size());
}

std::size_t count_opposed(const Points& normal, const Points& reference) {
  std::size_t count = 0;
  for (std::size_t i = 0; i < normal.size(); ++i) count += normal[i].dot(reference[i]) < 0.0F ? 1U : 0U;
  return count;
}

double relative_error(double value, double expected) {
  return std::abs(value - expected) / std::abs(expected);
}

bool all_finite(const Points& points) {
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!points[i].allFinite()) return false;
  }
  return true;
}

}  // namespace pointwright::test

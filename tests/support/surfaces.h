#pragma once
// Synthetic clouds with known answers. Everything is deterministic: the generator is ours, seeds are
// arguments.

#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

#include "engine/core/cloud.h"
#include "engine/core/points.h"

namespace pointwright::test {

/// SplitMix64 (Steele, Lea, Flood: "Fast splittable pseudorandom number generators", 2014).
class Random {
 public:
  explicit Random(std::uint64_t seed) : state_(seed) {}

  std::uint64_t bits();
  double uniform();                         ///< in [0, 1)
  double uniform(double low, double high);  ///< in [low, high)
  double normal();                          ///< mean 0, standard deviation 1
  std::size_t below(std::size_t count);     ///< in [0, count)
  Vec3d direction();                        ///< a unit vector, uniform on the sphere

 private:
  std::uint64_t state_;
};

/// Samples in coherent order with the true unit normals of the surface they stand on.
struct Surface {
  Points position;
  Points normal;

  [[nodiscard]] std::size_t size() const { return position.size(); }
};

enum class Sampling {
  kRegular,   ///< a square lattice; on curved surfaces a Fibonacci or another low-discrepancy lattice
  kJittered,  ///< the lattice, each sample moved by up to 0.3 spacings along each of its axes
  kRandom,    ///< uniform and independent (Poisson): clumps and holes
};

/// side x side samples of the plane z = 0 around the origin, normals +z.
Surface plane(std::size_t side, double spacing, Sampling sampling, std::uint64_t seed = 1);
/// The plane with height z = amplitude sin(2 pi x / wavelength).
Surface wave(std::size_t side, double spacing, Sampling sampling, double amplitude, double wavelength,
             std::uint64_t seed = 1);
/// Two planes at z = -gap/2 (normals -z) and z = +gap/2 (normals +z).
Surface parallel_sheets(std::size_t side, double spacing, double gap, Sampling sampling,
                        std::uint64_t seed = 1);
/// Around the origin, normals outward. kJittered is not offered.
Surface sphere(std::size_t count, double radius, Sampling sampling, std::uint64_t seed = 1);
/// The half z >= 0 of a sphere of 2 count samples.
Surface hemisphere(std::size_t count, double radius);
/// An ellipsoid with these half axes: samples of the unit sphere, stretched.
Surface ellipsoid(std::size_t count, const Vec3d& half_axes);
/// Around the z axis, area-uniform, normals outward.
Surface torus(std::size_t count, double major, double minor, Sampling sampling, std::uint64_t seed = 1);
/// The six faces of [-half, half]^3 with sharp edges: side x side samples a face, none on an edge.
Surface cube(std::size_t side, double half, std::uint64_t seed = 1);

/// A pattern of Gaussian bumps around the points of a Fibonacci lattice, as evenly spaced as can be.
struct Bumps {
  std::size_t count = 500;
  double height = 0.01;  ///< of a single bump
  double width = 0.03;   ///< standard deviation, on the unit sphere

  [[nodiscard]] double spacing() const;  ///< between neighbouring bumps: the wavelength
};
/// The unit sphere with a bump pattern, normals exact. Samples stand over the Fibonacci lattice.
Surface bumpy_sphere(std::size_t count, const Bumps& bumps);

/// Every sample moved along its normal by height(position); the normals stay those of the old surface.
Surface displaced(const Surface& surface, const std::function<double(const Vec3d&)>& height);
/// Gaussian noise of this standard deviation on every coordinate.
Surface with_noise(const Surface& surface, double sigma, std::uint64_t seed = 1);
Surface moved(const Surface& surface, const Vec3d& offset);
/// All the samples together, in coherent order.
Surface joined(const std::vector<Surface>& parts);
/// The samples in coherent order.
Surface coherent(const Surface& surface);

/// Degenerate sets, already in coherent order.
Points identical(std::size_t count, const Vec3f& where);
Points collinear(std::size_t count, const Vec3f& from, const Vec3f& to);
Points from_list(const std::vector<Vec3f>& list);
Points coherent(const Points& points);

/// The points in another order: point i of the result is point order[i].
Points reordered(const Points& points, const std::vector<std::uint32_t>& order);

/// A cloud of these positions; ids count up.
Cloud to_cloud(const Points& position);
/// A cloud that brings its normals along.
Cloud to_cloud(const Surface& surface);

/// Flips about half of the normals.
Points scrambled_signs(const Points& normal, std::uint64_t seed);
/// The angle between two lines along unit vectors, whatever their signs, in radians.
double line_angle(const Vec3f& a, const Vec3f& b);
double mean_line_angle(const Points& a, const Points& b);
/// Samples whose normal lies on the other side of the reference's.
std::size_t count_opposed(const Points& normal, const Points& reference);
bool all_finite(const Points& points);
/// |value - expected| / |expected|.
double relative_error(double value, double expected);

}  // namespace pointwright::test

#pragma once
// What the libraries are compared on: samples, the surface that they stand on, and a mesh of the same
// surface.

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "engine/core/points.h"
#include "tests/support/surface_distance.h"

namespace pointwright::peers {

struct TriangleMesh {
  std::vector<Vec3d> vertex;
  std::vector<std::array<std::uint32_t, 3>> triangle;
};

struct Model {
  std::string name;
  Points samples;                  ///< in random order, without normals
  test::SurfaceDistance distance;  ///< to the surface without noise; empty where it is not known
  TriangleMesh mesh;               ///< about as many vertices as samples; empty where there is none
};

/// The synthetic scan of the benchmarks: smooth, with bumps of three wavelengths. The mesh is a lattice of
/// the torus' two angles. Noise is Gaussian on every coordinate of samples and vertices.
Model scan_model(std::size_t samples, double noise);

/// Three square slabs, one upon the other: flats that meet in sharp edges, inward and outward. Samples are
/// uniform by area, so none stands on an edge; nor does a vertex of the mesh, as in a mesh made from a scan.
/// The mesh has at most 40,000 vertices.
Model steps_model(std::size_t samples);

/// Exact to rounding, for points within about 0.03 of the scan's surface.
double distance_to_scan(const Vec3d& p);
/// Unit normal of the scan's surface where p's foot is.
Vec3f scan_normal(const Vec3d& p);
/// Exact.
double distance_to_steps(const Vec3d& p);

}  // namespace pointwright::peers

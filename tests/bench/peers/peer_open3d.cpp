// Open3D: searches by the nanoflann that it carries.
#include <omp.h>
#include <open3d/Open3DConfig.h>
#include <open3d/geometry/KDTreeFlann.h>
#include <open3d/geometry/KDTreeSearchParam.h>
#include <open3d/geometry/PointCloud.h>
#include <open3d/geometry/TriangleMesh.h>

#include <limits>
#include <memory>

#include "engine/core/parallel.h"
#include "tests/bench/peers/library.h"

namespace pointwright::peers {
namespace {

namespace geometry = open3d::geometry;

std::shared_ptr<geometry::PointCloud> cloud_of(const Points& points) {
  auto cloud = std::make_shared<geometry::PointCloud>();
  for (std::size_t i = 0; i < points.size(); ++i) cloud->points_.push_back(points[i].cast<double>());
  return cloud;
}

void store(const std::vector<Vec3d>& points, Points& result) {
  result.resize(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) result.set(i, points[i].cast<float>());
}

std::function<void(NeighborLists&)> load_search(const Points& points, std::uint32_t k) {
  return [cloud = cloud_of(points), k](NeighborLists& lists) {
    const geometry::KDTreeFlann tree(*cloud);
    search_all(cloud->points_.size(), k, lists, [&](std::size_t i, std::uint32_t* found) {
      thread_local std::vector<int> indices;
      thread_local std::vector<double> distances;
      tree.SearchKNN(cloud->points_[i], static_cast<int>(k) + 1, indices, distances);
      for (const int index : indices) *found++ = static_cast<std::uint32_t>(index);
    });
  };
}

std::function<void(Points&)> load_normals(const Points& points, std::uint32_t k) {
  return [cloud = cloud_of(points), k](Points& normal) {
    omp_set_num_threads(thread_count());
    // Normals that are there would be kept on their sides; the sample itself is one of the neighbours.
    cloud->normals_.clear();
    cloud->EstimateNormals(geometry::KDTreeSearchParamKNN(static_cast<int>(k) + 1));
    store(cloud->normals_, normal);
  };
}

std::function<void(double, Points&)> load_voxel_grid(const Model& model) {
  return [cloud = cloud_of(model.samples)](double cell, Points& result) {
    store(cloud->VoxelDownSample(cell)->points_, result);
  };
}

std::function<void(double, Points&)> load_mesh_quadrics(const Model& model) {
  geometry::TriangleMesh mesh;
  mesh.vertices_ = model.mesh.vertex;
  for (const auto& [a, b, c] : model.mesh.triangle) {
    mesh.triangles_.emplace_back(static_cast<int>(a), static_cast<int>(b), static_cast<int>(c));
  }
  return [mesh = std::move(mesh)](double count, Points& result) {
    // A closed mesh of V vertices has 2 V triangles and a few.
    const auto kept = mesh.SimplifyQuadricDecimation(static_cast<int>(2.0 * count),
                                                     std::numeric_limits<double>::infinity(), 1.0);
    store(kept->vertices_, result);
  };
}

}  // namespace

Library open3d_library() {
  return {.name = "Open3D",
          .version = OPEN3D_VERSION,
          .searches = {{"Open3D", load_search}},
          .estimators = {{"Open3D", load_normals}},
          .simplifiers = {{"Open3D voxel grid", Control::kCell, false, kAnyCount, load_voxel_grid},
                          {"Open3D mesh quadrics", Control::kCount, true, 200'000, load_mesh_quadrics}}};
}

}  // namespace pointwright::peers

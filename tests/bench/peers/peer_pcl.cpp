// PCL: searches by FLANN.
#include <pcl/features/normal_3d_omp.h>
#include <pcl/filters/voxel_grid.h>
#include <pcl/pcl_config.h>
#include <pcl/point_cloud.h>
#include <pcl/point_types.h>
#include <pcl/search/kdtree.h>

#include "engine/core/parallel.h"
#include "tests/bench/peers/library.h"

namespace pointwright::peers {
namespace {

using CloudOfPcl = pcl::PointCloud<pcl::PointXYZ>;

CloudOfPcl::Ptr cloud_of(const Points& points) {
  CloudOfPcl::Ptr cloud(new CloudOfPcl);
  for (std::size_t i = 0; i < points.size(); ++i) {
    cloud->push_back(pcl::PointXYZ(points[i].x(), points[i].y(), points[i].z()));
  }
  return cloud;
}

std::function<void(NeighborLists&)> load_search(const Points& points, std::uint32_t k) {
  return [cloud = cloud_of(points), k](NeighborLists& lists) {
    pcl::search::KdTree<pcl::PointXYZ> tree;
    tree.setInputCloud(cloud);
    search_all(cloud->size(), k, lists, [&](std::size_t i, std::uint32_t* found) {
      thread_local pcl::Indices indices;
      thread_local std::vector<float> distances;
      tree.nearestKSearch((*cloud)[i], static_cast<int>(k) + 1, indices, distances);
      for (const auto index : indices) *found++ = static_cast<std::uint32_t>(index);
    });
  };
}

std::function<void(Points&)> load_normals(const Points& points, std::uint32_t k) {
  return [cloud = cloud_of(points), k](Points& normal) {
    pcl::NormalEstimationOMP<pcl::PointXYZ, pcl::Normal> estimation(static_cast<unsigned>(thread_count()));
    estimation.setInputCloud(cloud);
    estimation.setSearchMethod(pcl::make_shared<pcl::search::KdTree<pcl::PointXYZ>>());
    estimation.setKSearch(static_cast<int>(k) + 1);  // the sample itself is one of them
    pcl::PointCloud<pcl::Normal> normals;
    estimation.compute(normals);
    for (std::size_t i = 0; i < normals.size(); ++i) normal.set(i, normals[i].getNormalVector3fMap());
  };
}

std::function<void(double, Points&)> load_voxel_grid(const Model& model) {
  return [cloud = cloud_of(model.samples)](double cell, Points& result) {
    pcl::VoxelGrid<pcl::PointXYZ> grid;
    grid.setInputCloud(cloud);
    const auto leaf = static_cast<float>(cell);
    grid.setLeafSize(leaf, leaf, leaf);
    CloudOfPcl kept;
    grid.filter(kept);
    result.resize(kept.size());
    for (std::size_t i = 0; i < kept.size(); ++i) result.set(i, kept[i].getVector3fMap());
  };
}

}  // namespace

Library pcl_library() {
  return {.name = "PCL",
          .version = PCL_VERSION_PRETTY,
          .searches = {{"PCL (FLANN)", load_search}},
          .estimators = {{"PCL", load_normals}},
          .simplifiers = {{"PCL voxel grid", Control::kCell, false, kAnyCount, load_voxel_grid}}};
}

}  // namespace pointwright::peers

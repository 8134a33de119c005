#include "engine/editing/culled_shape.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <numeric>

#include "engine/editing/segment.h"

namespace pointwright {
namespace {

constexpr std::size_t kLeafCapsules = 8;
// Of coordinates and distances: what culling leaves to the rounding of the exact test.
constexpr double kSlack = 1e-12;

bool overlap(const Box3d& a, const Box3d& b) {
  return (a.min.array() <= b.max.array()).all() && (a.max.array() >= b.min.array()).all();
}

// Wider by `reach` and a little more: the exact test rounds too.
Box3d widened(const Box3d& box, double reach) {
  const Vec3d margin =
      (Vec3d::Constant(reach) + (box.min.cwiseAbs() + box.max.cwiseAbs()) * kSlack) * (1.0 + kSlack);
  return {box.min - margin, box.max + margin};
}

double largest(const Vec3d& v) {
  return v.cwiseAbs().maxCoeff();
}

}  // namespace

CapsuleTree::CapsuleTree(const Stroke& stroke) : vertices_(&stroke.vertices), radius_(stroke.radius) {
  build(std::max<std::size_t>(stroke.vertices.size(), 2) - 1);
}

CapsuleTree::CapsuleTree(const PointSet& points) : vertices_(&points.points), radii_(&points.radii) {
  build(points.points.size());
}

void CapsuleTree::build(std::size_t count) {
  order_.resize(count);
  std::iota(order_.begin(), order_.end(), 0U);
  nodes_.reserve(2 * (count / (kLeafCapsules / 2) + 1));
  split(0, count);
}

const Vec3d& CapsuleTree::second_end(std::size_t capsule) const {
  if (radii_ != nullptr) return first_end(capsule);
  return (*vertices_)[std::min(capsule + 1, vertices_->size() - 1)];
}

double CapsuleTree::radius(std::size_t capsule) const {
  if (radii_ == nullptr) return radius_;
  return radii_->size() == 1 ? radii_->front() : (*radii_)[capsule];
}

void CapsuleTree::split(std::size_t begin, std::size_t end) {
  const std::size_t at = nodes_.size();
  Node node{.begin = static_cast<std::uint32_t>(begin), .end = static_cast<std::uint32_t>(end)};
  Box3d middles;
  for (std::size_t i = begin; i < end; ++i) {
    Box3d capsule;
    capsule.extend(first_end(order_[i]));
    capsule.extend(second_end(order_[i]));
    capsule = widened(capsule, radius(order_[i]));
    node.box.extend(capsule.min);
    node.box.extend(capsule.max);
    middles.extend(first_end(order_[i]) + second_end(order_[i]));
  }
  nodes_.push_back(node);
  if (end - begin <= kLeafCapsules) return;
  Eigen::Index axis = 0;
  (middles.max - middles.min).maxCoeff(&axis);
  const std::size_t half = begin + (end - begin) / 2;
  const auto place = [&](std::size_t i) { return order_.begin() + static_cast<std::ptrdiff_t>(i); };
  std::nth_element(place(begin), place(half), place(end), [&](std::uint32_t a, std::uint32_t b) {
    return first_end(a)[axis] + second_end(a)[axis] < first_end(b)[axis] + second_end(b)[axis];
  });
  split(begin, half);
  nodes_[at].right = static_cast<std::uint32_t>(nodes_.size());
  split(half, end);
}

void CapsuleTree::within_reach(const Box3d& box, std::vector<std::uint32_t>& found) const {
  found.clear();
  const Box3d wide = widened(box, 0.0);
  std::array<std::uint32_t, 64> open{};  // the tree is balanced: at most one entry a level
  std::size_t depth = 0;
  open[depth++] = 0;
  while (depth > 0) {
    const std::uint32_t at = open[--depth];
    const Node& node = nodes_[at];
    if (!overlap(wide, node.box)) continue;
    if (node.right != 0) {
      open[depth++] = node.right;
      open[depth++] = at + 1;
      continue;
    }
    for (std::uint32_t i = node.begin; i < node.end; ++i) {
      if (reaches(order_[i], box)) found.push_back(order_[i]);
    }
  }
}

bool CapsuleTree::reaches(std::uint32_t capsule, const Box3d& box) const {
  const Vec3d& a = first_end(capsule);
  const Vec3d& b = second_end(capsule);
  const double r = radius(capsule);
  const Vec3d center = 0.5 * (box.min + box.max);
  const double reach = r + 0.5 * (box.max - box.min).norm();
  const double size = largest(box.min) + largest(box.max) + largest(a) + largest(b) + r;
  return std::sqrt(segment_distance_sq(a, b, center)) <= reach + size * kSlack;
}

bool CapsuleTree::contains(std::uint32_t capsule, const Vec3d& point) const {
  const double r = radius(capsule);
  return segment_distance_sq(first_end(capsule), second_end(capsule), point) <= r * r;
}

CulledShape::CulledShape(const Shape& shape) : shape_(&shape) {
  if (const auto* stroke = std::get_if<Stroke>(&shape)) tree_.emplace(*stroke);
  if (const auto* points = std::get_if<PointSet>(&shape)) tree_.emplace(*points);
  if (const auto* screen = std::get_if<ScreenShape>(&shape)) outline_.emplace(*screen);
  if (const auto* image = std::get_if<ImageShape>(&shape)) image_.emplace(*image);
}

bool CulledShape::may_cover(const Box3d& box, std::vector<std::uint32_t>& capsules) const {
  if (!tree_) return may_cover(box);
  tree_->within_reach(box, capsules);
  return !capsules.empty();
}

bool CulledShape::may_cover(const Box3d& box, const std::vector<std::uint32_t>& from,
                            std::vector<std::uint32_t>& capsules) const {
  if (!tree_) return may_cover(box);
  capsules.clear();
  std::ranges::copy_if(from, std::back_inserter(capsules),
                       [&](std::uint32_t i) { return tree_->reaches(i, box); });
  return !capsules.empty();
}

bool CulledShape::covers(const Vec3d& point, const TexCoord* texcoord,
                         const std::vector<std::uint32_t>& capsules) const {
  if (image_) return image_->covers(point, texcoord);
  if (outline_) {
    const std::optional<Vec2d> place = project(std::get<ScreenShape>(*shape_), point);
    return place && outline_->contains(*place);
  }
  if (!tree_) return contains(*shape_, point);
  return std::any_of(capsules.begin(), capsules.end(),
                     [&](std::uint32_t i) { return tree_->contains(i, point); });
}

bool CulledShape::may_cover(const Box3d& box) const {
  if (const auto* sphere = std::get_if<Sphere>(shape_)) {
    return overlap(box, widened({sphere->center, sphere->center}, sphere->radius));
  }
  if (const auto* axis_box = std::get_if<AxisBox>(shape_)) {
    return overlap(box, {axis_box->min, axis_box->max});
  }
  if (image_) return image_->may_cover(0.5 * (box.min + box.max), 0.5 * (box.max - box.min));
  return true;
}

}  // namespace pointwright

// Painting operations and their shapes: documents to values and back.

#include <array>

#include "protocol/json/request_members.h"

namespace pointwright::protocol {
namespace {

// In the order of Shape's alternatives.
constexpr std::array<std::string_view, 6> kShapeNames{"sphere",     "stroke", "box",
                                                      "half_space", "all",    "points"};
static_assert(std::variant_size_v<Shape> == kShapeNames.size());
// In the order of PaintMode.
constexpr std::array<std::string_view, 8> kPaintModeNames{"add",    "remove", "intersect", "set",
                                                          "invert", "clear",  "grow",      "shrink"};

/// The engine checks the values too; the limit only bounds what is copied out of the document.
std::vector<Vec3d> required_points(ObjectReader& object, std::string_view name) {
  std::vector<Vec3d> points;
  const Json* const member = object.required(name);
  if (member == nullptr) return points;
  const std::string pointer = object.pointer_to(name);
  const Json* const array = read_array(*member, pointer, object.errors(), 1, kMaxStrokeVertices);
  if (array == nullptr) return points;
  points.reserve(array->size());
  for (std::size_t i = 0; i < array->size(); ++i) {
    const auto point = read_vec3((*array)[i], child_pointer(pointer, i), object.errors());
    points.push_back(point.value_or(Vec3d::Zero()));
  }
  return points;
}

/// One `radius` for all points, or `radii` with one for each.
PointSet read_point_set(ObjectReader& object) {
  PointSet set{.points = required_points(object, "points"), .radii = {}};
  const Json* const radii = object.optional("radii");
  if (radii == nullptr) {
    set.radii.push_back(required_number(object, "radius"));
    return set;
  }
  const std::string pointer = object.pointer_to("radii");
  const std::size_t count = set.points.size();
  if (const Json* const array = read_array(*radii, pointer, object.errors(), count, count)) {
    set.radii.reserve(count);
    for (std::size_t i = 0; i < array->size(); ++i)
      set.radii.push_back(read_number((*array)[i], child_pointer(pointer, i), object.errors()).value_or(0.0));
  }
  return set;
}

Shape read_shape(const Json& value, const std::string& pointer, JsonErrors& errors) {
  ObjectReader object(value, pointer, errors);
  const auto type = required_choice(object, "type", kShapeNames);
  if (!type) return Everything{};  // what members it may have is unknown then
  Shape shape = Everything{};
  if (kShapeNames[*type] == "sphere") {
    shape = Sphere{.center = required_vec3(object, "center"), .radius = required_number(object, "radius")};
  } else if (kShapeNames[*type] == "stroke") {
    shape =
        Stroke{.vertices = required_points(object, "vertices"), .radius = required_number(object, "radius")};
  } else if (kShapeNames[*type] == "box") {
    shape = AxisBox{.min = required_vec3(object, "min"), .max = required_vec3(object, "max")};
  } else if (kShapeNames[*type] == "half_space") {
    shape = HalfSpace{.point = required_vec3(object, "point"), .normal = required_vec3(object, "normal")};
  } else if (kShapeNames[*type] == "points") {
    shape = read_point_set(object);
  }
  object.finish();
  return shape;
}

PaintOperation read_paint_operation(const Json& value, const std::string& pointer, JsonErrors& errors) {
  const std::size_t faults_before = errors.fault_count;
  PaintOperation operation;
  ObjectReader object(value, pointer, errors);
  const auto mode = required_choice(object, "mode", kPaintModeNames);
  if (!mode) return operation;  // what members it may have is unknown then
  operation.mode = static_cast<PaintMode>(*mode);
  if (has_shape(operation.mode)) {
    if (const Json* const shape = object.required("shape"))
      operation.shape = read_shape(*shape, object.pointer_to("shape"), errors);
    if (const Json* const facing = object.optional("facing"))
      operation.facing = read_vec3(*facing, object.pointer_to("facing"), errors);
  }
  if (has_distance(operation.mode)) operation.distance = required_number(object, "distance");
  if (const Json* const steal = object.optional("steal"))
    operation.steal = read_bool(*steal, object.pointer_to("steal"), errors).value_or(false);
  object.finish();
  if (errors.fault_count == faults_before) add_verdict(validate(operation), pointer, errors);
  return operation;
}

JsonDocument points_to_json(const std::vector<Vec3d>& points) {
  JsonDocument array = JsonDocument::array();
  for (const Vec3d& point : points) array.push_back(to_json(point));
  return array;
}

void put_members(const Sphere& sphere, JsonDocument& document) {
  document["center"] = to_json(sphere.center);
  document["radius"] = sphere.radius;
}
void put_members(const Stroke& stroke, JsonDocument& document) {
  document["vertices"] = points_to_json(stroke.vertices);
  document["radius"] = stroke.radius;
}
void put_members(const AxisBox& box, JsonDocument& document) {
  document["min"] = to_json(box.min);
  document["max"] = to_json(box.max);
}
void put_members(const HalfSpace& half_space, JsonDocument& document) {
  document["point"] = to_json(half_space.point);
  document["normal"] = to_json(half_space.normal);
}
void put_members(const Everything&, JsonDocument&) {}
void put_members(const PointSet& set, JsonDocument& document) {
  document["points"] = points_to_json(set.points);
  if (set.radii.size() == 1) {
    document["radius"] = set.radii.front();
  } else {
    document["radii"] = set.radii;
  }
}

}  // namespace

Parsed<PaintOperation> parse_paint_operation(const Json& document) {
  JsonErrors errors;
  PaintOperation operation = read_paint_operation(document, "", errors);
  return value_or_errors(std::move(operation), std::move(errors));
}

Parsed<std::vector<PaintOperation>> parse_painting(const Json& document) {
  JsonErrors errors;
  std::vector<PaintOperation> painting;
  ObjectReader object(document, "", errors);
  if (const Json* const member = object.required("operations")) {
    const std::string pointer = object.pointer_to("operations");
    if (const Json* const array = read_array(*member, pointer, errors, 0, kMaxPaintOperations)) {
      painting.reserve(array->size());
      for (std::size_t i = 0; i < array->size(); ++i) {
        painting.push_back(read_paint_operation((*array)[i], child_pointer(pointer, i), errors));
      }
    }
  }
  object.finish();
  return value_or_errors(std::move(painting), std::move(errors));
}

JsonDocument to_json(const Shape& shape) {
  JsonDocument document{{"type", kShapeNames[shape.index()]}};
  std::visit([&](const auto& each) { put_members(each, document); }, shape);
  return document;
}

JsonDocument to_json(const PaintOperation& operation) {
  JsonDocument document{{"mode", kPaintModeNames[static_cast<std::size_t>(operation.mode)]}};
  if (has_shape(operation.mode)) document["shape"] = to_json(operation.shape);
  if (has_distance(operation.mode)) document["distance"] = operation.distance;
  if (operation.facing) document["facing"] = to_json(*operation.facing);
  if (operation.steal) document["steal"] = true;
  return document;
}

}  // namespace pointwright::protocol

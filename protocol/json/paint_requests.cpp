// Painting operations and their shapes: documents to values and back.

#include <algorithm>
#include <array>

#include "protocol/json/request_members.h"

namespace pointwright::protocol {
namespace {

// In the order of Shape's alternatives.
constexpr std::array<std::string_view, 10> kShapeNames{"sphere", "stroke", "box",   "half_space", "all",
                                                       "points", "screen", "image", "model",      "region"};
static_assert(std::variant_size_v<Shape> == kShapeNames.size());
// In the order of ScreenShape::outline's alternatives.
constexpr std::array<std::string_view, 3> kOutlineNames{"polygon", "ellipse", "polyline"};
// In the order of ImageChannel.
constexpr std::array<std::string_view, 5> kChannelNames{"luminance", "red", "green", "blue", "alpha"};
constexpr std::array<std::string_view, 2> kSideNames{"above", "below"};
// In the order of ImageShape::projection's alternatives.
constexpr std::array<std::string_view, 2> kProjectionNames{"texture", "planar"};
// In the order of PaintMode.
constexpr std::array<std::string_view, 9> kPaintModeNames{"add",   "remove", "intersect", "set",  "invert",
                                                          "clear", "grow",   "shrink",    "flood"};

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

/// Exactly `count` numbers.
std::vector<double> read_numbers(const Json& value, const std::string& pointer, JsonErrors& errors,
                                 std::size_t count) {
  std::vector<double> numbers;
  if (const Json* const array = read_array(value, pointer, errors, count, count)) {
    for (std::size_t i = 0; i < count; ++i)
      numbers.push_back(read_number((*array)[i], child_pointer(pointer, i), errors).value_or(0.0));
  }
  numbers.resize(count);
  return numbers;
}

Vec2d read_vec2(const Json& value, const std::string& pointer, JsonErrors& errors) {
  const std::vector<double> numbers = read_numbers(value, pointer, errors, 2);
  return {numbers[0], numbers[1]};
}

Vec2d required_vec2(ObjectReader& object, std::string_view name) {
  const Json* const member = object.required(name);
  if (member == nullptr) return Vec2d::Zero();
  return read_vec2(*member, object.pointer_to(name), object.errors());
}

std::vector<Vec2d> required_outline_vertices(ObjectReader& object, std::size_t least) {
  std::vector<Vec2d> vertices;
  const Json* const member = object.required("vertices");
  if (member == nullptr) return vertices;
  const std::string pointer = object.pointer_to("vertices");
  const Json* const array = read_array(*member, pointer, object.errors(), least, kMaxOutlineVertices);
  if (array == nullptr) return vertices;
  for (std::size_t i = 0; i < array->size(); ++i)
    vertices.push_back(read_vec2((*array)[i], child_pointer(pointer, i), object.errors()));
  return vertices;
}

/// 16 numbers, row after row.
ShapeMatrix required_matrix(ObjectReader& object, std::string_view name) {
  ShapeMatrix matrix{};
  if (const Json* const member = object.required(name)) {
    const auto numbers = read_numbers(*member, object.pointer_to(name), object.errors(), matrix.size());
    std::ranges::copy(numbers, matrix.begin());
  }
  return matrix;
}

ScreenShape read_screen(ObjectReader& object) {
  ScreenShape screen{.view = required_matrix(object, "view"), .outline = {}};
  if (const Json* const visible = object.optional("visible"))
    screen.visible = read_bool(*visible, object.pointer_to("visible"), object.errors()).value_or(false);
  const Json* const member = object.required("outline");
  if (member == nullptr) return screen;
  ObjectReader outline(*member, object.pointer_to("outline"), object.errors());
  const auto type = required_choice(outline, "type", kOutlineNames);
  if (!type) return screen;
  if (kOutlineNames[*type] == "polygon") {
    screen.outline = ScreenPolygon{.vertices = required_outline_vertices(outline, 3)};
  } else if (kOutlineNames[*type] == "ellipse") {
    screen.outline = ScreenEllipse{.center = required_vec2(outline, "center"),
                                   .half_axes = required_vec2(outline, "half_axes")};
  } else {
    screen.outline = ScreenPolyline{.vertices = required_outline_vertices(outline, 1),
                                    .width = required_number(outline, "width")};
  }
  outline.finish();
  return screen;
}

/// One of the names, or the first.
std::size_t optional_choice(ObjectReader& object, std::string_view name,
                            std::span<const std::string_view> names) {
  const Json* const member = object.optional(name);
  if (member == nullptr) return 0;
  return read_choice(*member, object.pointer_to(name), object.errors(), names).value_or(0);
}

PlanarProjection read_plane(ObjectReader& object) {
  PlanarProjection plane{.origin = required_vec3(object, "origin"),
                         .u = required_vec3(object, "u"),
                         .v = required_vec3(object, "v"),
                         .depth = std::nullopt};
  if (const Json* const depth = object.optional("depth")) {
    const auto ends = read_numbers(*depth, object.pointer_to("depth"), object.errors(), 2);
    plane.depth = {ends[0], ends[1]};
  }
  return plane;
}

ImageShape read_image(ObjectReader& object) {
  ImageShape shape;
  shape.source = required_id(object, "image", "an image");
  shape.channel = static_cast<ImageChannel>(optional_choice(object, "channel", kChannelNames));
  if (const Json* const threshold = object.optional("threshold"))
    shape.threshold =
        read_number(*threshold, object.pointer_to("threshold"), object.errors(), {.min = 0.0, .max = 1.0})
            .value_or(0.0);
  shape.above = optional_choice(object, "side", kSideNames) == 0;
  const Json* const member = object.required("projection");
  if (member == nullptr) return shape;
  ObjectReader projection(*member, object.pointer_to("projection"), object.errors());
  const auto type = required_choice(projection, "type", kProjectionNames);
  if (!type) return shape;
  if (kProjectionNames[*type] == "planar") {
    shape.projection = read_plane(projection);
  } else if (const Json* const repeat = projection.optional("repeat")) {
    shape.projection = TextureProjection{
        .repeat = read_bool(*repeat, projection.pointer_to("repeat"), object.errors()).value_or(false)};
  }
  projection.finish();
  return shape;
}

ModelShape read_model(ObjectReader& object) {
  ModelShape shape;
  shape.source = required_id(object, "cloud", "a cloud");
  shape.matrix = required_matrix(object, "matrix");
  shape.thickness = required_number(object, "thickness");
  return shape;
}

RegionShape read_region(ObjectReader& object) {
  RegionShape shape;
  if (const Json* const name = object.required("region")) {
    const std::string pointer = object.pointer_to("region");
    shape.source = read_string(*name, pointer, object.errors()).value_or("");
    if (name->is_string() && !region_of_name(shape.source) && !is_valid_region_name(shape.source))
      object.errors().add(pointer, "must be zero, one or the name of a region");
  }
  return shape;
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
  } else if (kShapeNames[*type] == "screen") {
    shape = read_screen(object);
  } else if (kShapeNames[*type] == "image") {
    shape = read_image(object);
  } else if (kShapeNames[*type] == "model") {
    shape = read_model(object);
  } else if (kShapeNames[*type] == "region") {
    shape = read_region(object);
  }
  object.finish();
  return shape;
}

FloodFill read_flood(ObjectReader& object) {
  FloodFill flood{.seed = required_vec3(object, "seed")};
  JsonErrors& errors = object.errors();
  if (const Json* const angle = object.optional("angle_deg")) {
    if (const auto degrees =
            read_number(*angle, object.pointer_to("angle_deg"), errors, {.min = 0.0, .max = 180.0}))
      flood.angle_rad = to_radians(*degrees);
  }
  if (const Json* const radius = object.optional("radius"))
    flood.radius = read_number(*radius, object.pointer_to("radius"), errors);
  if (const Json* const stop = object.optional("stop_at_other"))
    flood.stop_at_other = read_bool(*stop, object.pointer_to("stop_at_other"), errors).value_or(false);
  return flood;
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
  if (operation.mode == PaintMode::kFlood) operation.flood = read_flood(object);
  if (const Json* const steal = object.optional("steal"))
    operation.steal = read_bool(*steal, object.pointer_to("steal"), errors).value_or(false);
  object.finish();
  if (errors.fault_count == faults_before) add_verdict(validate(operation), pointer, errors);
  return operation;
}

JsonDocument vec2_to_json(const Vec2d& vector) {
  return JsonDocument::array({vector.x(), vector.y()});
}

void put_members(const FloodFill& flood, JsonDocument& document) {
  document["seed"] = to_json(flood.seed);
  if (flood.angle_rad) document["angle_deg"] = to_degrees(*flood.angle_rad);
  if (flood.radius) document["radius"] = *flood.radius;
  if (flood.stop_at_other) document["stop_at_other"] = true;
}

JsonDocument outline_vertices(const std::vector<Vec2d>& vertices) {
  JsonDocument array = JsonDocument::array();
  for (const Vec2d& vertex : vertices) array.push_back(vec2_to_json(vertex));
  return array;
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
void put_outline(const ScreenPolygon& polygon, JsonDocument& document) {
  document["vertices"] = outline_vertices(polygon.vertices);
}
void put_outline(const ScreenEllipse& ellipse, JsonDocument& document) {
  document["center"] = vec2_to_json(ellipse.center);
  document["half_axes"] = vec2_to_json(ellipse.half_axes);
}
void put_outline(const ScreenPolyline& line, JsonDocument& document) {
  document["vertices"] = outline_vertices(line.vertices);
  document["width"] = line.width;
}
void put_members(const ScreenShape& screen, JsonDocument& document) {
  document["view"] = screen.view;
  JsonDocument outline{{"type", kOutlineNames[screen.outline.index()]}};
  std::visit([&](const auto& each) { put_outline(each, outline); }, screen.outline);
  document["outline"] = std::move(outline);
  if (screen.visible) document["visible"] = true;
}
void put_projection(const TextureProjection& texture, JsonDocument& document) {
  document["repeat"] = texture.repeat;
}
void put_projection(const PlanarProjection& plane, JsonDocument& document) {
  document["origin"] = to_json(plane.origin);
  document["u"] = to_json(plane.u);
  document["v"] = to_json(plane.v);
  if (plane.depth) document["depth"] = *plane.depth;
}
void put_members(const ImageShape& image, JsonDocument& document) {
  document["image"] = image.source;
  document["channel"] = kChannelNames[static_cast<std::size_t>(image.channel)];
  document["threshold"] = image.threshold;
  document["side"] = kSideNames[image.above ? 0 : 1];
  JsonDocument projection{{"type", kProjectionNames[image.projection.index()]}};
  std::visit([&](const auto& each) { put_projection(each, projection); }, image.projection);
  document["projection"] = std::move(projection);
}
void put_members(const ModelShape& model, JsonDocument& document) {
  document["cloud"] = model.source;
  document["matrix"] = model.matrix;
  document["thickness"] = model.thickness;
}
void put_members(const RegionShape& region, JsonDocument& document) {
  document["region"] = region.source;
}

}  // namespace

Parsed<PaintOperation> parse_paint_operation(const Json& document) {
  JsonErrors errors;
  PaintOperation operation = read_paint_operation(document, "", errors);
  return value_or_errors(std::move(operation), std::move(errors));
}

std::vector<PaintOperation> read_operations(ObjectReader& object) {
  std::vector<PaintOperation> painting;
  JsonErrors& errors = object.errors();
  if (const Json* const member = object.required("operations")) {
    const std::string pointer = object.pointer_to("operations");
    if (const Json* const array = read_array(*member, pointer, errors, 0, kMaxPaintOperations)) {
      painting.reserve(array->size());
      for (std::size_t i = 0; i < array->size(); ++i) {
        painting.push_back(read_paint_operation((*array)[i], child_pointer(pointer, i), errors));
      }
    }
  }
  return painting;
}

Parsed<std::vector<PaintOperation>> parse_painting(const Json& document) {
  JsonErrors errors;
  ObjectReader object(document, "", errors);
  std::vector<PaintOperation> painting = read_operations(object);
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
  if (operation.mode == PaintMode::kFlood) put_members(operation.flood, document);
  if (operation.facing) document["facing"] = to_json(*operation.facing);
  if (operation.steal) document["steal"] = true;
  return document;
}

}  // namespace pointwright::protocol

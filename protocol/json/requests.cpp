#include "protocol/json/requests.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "engine/multires/reconstruction.h"
#include "protocol/frames/frame.h"
#include "protocol/json/reader.h"

namespace pointwright::protocol {
namespace {

/// Strokes and the like are checked by the engine too; this only bounds what is copied out of the document.
constexpr std::size_t kMaxVertices = 100'000;

constexpr std::array<std::string_view, 5> kShapeNames{"sphere", "stroke", "box", "half_space", "all"};
constexpr std::array<std::string_view, 4> kPaintModeNames{"add", "remove", "intersect", "set"};
// In the order of ElementaryDeformation; a composition of several comes last.
constexpr std::array<std::string_view, 7> kDeformationNames{
    "translation", "along_normal", "toward_point", "rotation", "scale", "twist", "sequence"};
constexpr std::size_t kSequence = kDeformationNames.size() - 1;
static_assert(std::variant_size_v<ElementaryDeformation> == kSequence);
constexpr std::array<std::string_view, 4> kBlendNames{"quartic", "cubic", "quintic", "cosine"};

Vec3d required_vec3(ObjectReader& object, std::string_view name) {
  const Json* const member = object.required(name);
  if (member == nullptr) return Vec3d::Zero();
  return read_vec3(*member, object.pointer_to(name), object.errors()).value_or(Vec3d::Zero());
}

double required_number(ObjectReader& object, std::string_view name) {
  const Json* const member = object.required(name);
  if (member == nullptr) return 0.0;
  return read_number(*member, object.pointer_to(name), object.errors()).value_or(0.0);
}

std::optional<std::size_t> required_choice(ObjectReader& object, std::string_view name,
                                           std::span<const std::string_view> names) {
  const Json* const member = object.required(name);
  if (member == nullptr) return std::nullopt;
  return read_choice(*member, object.pointer_to(name), object.errors(), names);
}

Stroke read_stroke(ObjectReader& object) {
  Stroke stroke;
  if (const Json* const vertices = object.required("vertices")) {
    const std::string pointer = object.pointer_to("vertices");
    if (const Json* const array = read_array(*vertices, pointer, object.errors(), 1, kMaxVertices)) {
      stroke.vertices.reserve(array->size());
      for (std::size_t i = 0; i < array->size(); ++i) {
        const auto vertex = read_vec3((*array)[i], child_pointer(pointer, i), object.errors());
        stroke.vertices.push_back(vertex.value_or(Vec3d::Zero()));
      }
    }
  }
  stroke.radius = required_number(object, "radius");
  return stroke;
}

Shape read_shape(const Json& value, const std::string& pointer, JsonErrors& errors) {
  ObjectReader object(value, pointer, errors);
  const auto type = required_choice(object, "type", kShapeNames);
  if (!type) return Everything{};  // what members it may have is unknown then
  Shape shape = Everything{};
  if (kShapeNames[*type] == "sphere") {
    shape = Sphere{.center = required_vec3(object, "center"), .radius = required_number(object, "radius")};
  } else if (kShapeNames[*type] == "stroke") {
    shape = read_stroke(object);
  } else if (kShapeNames[*type] == "box") {
    shape = AxisBox{.min = required_vec3(object, "min"), .max = required_vec3(object, "max")};
  } else if (kShapeNames[*type] == "half_space") {
    shape = HalfSpace{.point = required_vec3(object, "point"), .normal = required_vec3(object, "normal")};
  }
  object.finish();
  return shape;
}

/// Adds the engine's verdict where the document itself was in order.
void add_verdict(const Result<void>& verdict, const std::string& pointer, JsonErrors& errors) {
  if (!verdict) errors.add(pointer + pointer_of_field(verdict.error().field), verdict.error().message);
}

PaintOperation read_paint_operation(const Json& value, const std::string& pointer, JsonErrors& errors) {
  const std::size_t faults_before = errors.fault_count;
  PaintOperation operation;
  ObjectReader object(value, pointer, errors);
  if (const auto mode = required_choice(object, "mode", kPaintModeNames)) {
    operation.mode = static_cast<PaintMode>(*mode);
  }
  if (const Json* const shape = object.required("shape")) {
    operation.shape = read_shape(*shape, object.pointer_to("shape"), errors);
  }
  if (const Json* const facing = object.optional("facing")) {
    operation.facing = read_vec3(*facing, object.pointer_to("facing"), errors);
  }
  if (const Json* const steal = object.optional("steal")) {
    operation.steal = read_bool(*steal, object.pointer_to("steal"), errors).value_or(false);
  }
  object.finish();
  if (errors.fault_count == faults_before) add_verdict(validate(operation), pointer, errors);
  return operation;
}

struct Axis {
  Vec3d point = Vec3d::Zero();
  Vec3d direction = Vec3d::UnitZ();
};

Axis required_axis(ObjectReader& object) {
  Axis axis;
  if (const Json* const member = object.required("axis")) {
    ObjectReader axis_object(*member, object.pointer_to("axis"), object.errors());
    axis.point = required_vec3(axis_object, "point");
    axis.direction = required_vec3(axis_object, "direction");
    axis_object.finish();
  }
  return axis;
}

ElementaryDeformation read_elementary(ObjectReader& object, std::size_t type) {
  const std::string_view name = kDeformationNames[type];
  if (name == "along_normal") return NormalOffset{.distance = required_number(object, "distance")};
  if (name == "toward_point")
    return TowardPoint{.target = required_vec3(object, "target"),
                       .amount = required_number(object, "amount")};
  if (name == "rotation") {
    const Axis axis = required_axis(object);
    return Rotation{.point = axis.point,
                    .axis = axis.direction,
                    .angle_rad = to_radians(required_number(object, "angle_deg"))};
  }
  if (name == "scale")
    return Scaling{.center = required_vec3(object, "center"), .factors = required_vec3(object, "factors")};
  if (name == "twist") {
    const Axis axis = required_axis(object);
    return Twist{.point = axis.point,
                 .axis = axis.direction,
                 .angle_rad = to_radians(required_number(object, "angle_deg")),
                 .length = required_number(object, "length")};
  }
  return Translation{.vector = required_vec3(object, "vector")};
}

Deformation read_deformation(const Json& value, const std::string& pointer, JsonErrors& errors) {
  ObjectReader object(value, pointer, errors);
  Deformation deformation;
  const auto type = required_choice(object, "type", kDeformationNames);
  if (!type) return deformation;
  if (*type != kSequence) {
    deformation = read_elementary(object, *type);
    object.finish();
    return deformation;
  }
  deformation.steps.clear();
  if (const Json* const steps = object.required("steps")) {
    const std::string place = object.pointer_to("steps");
    if (const Json* const array = read_array(*steps, place, errors, 1, kMaxDeformationSteps)) {
      for (std::size_t i = 0; i < array->size(); ++i) {
        ObjectReader step((*array)[i], child_pointer(place, i), errors);
        const std::span<const std::string_view> elementary(kDeformationNames.data(), kSequence);
        const auto kind = required_choice(step, "type", elementary);
        if (!kind) continue;
        deformation.steps.push_back(read_elementary(step, *kind));
        step.finish();
      }
    }
  }
  object.finish();
  return deformation;
}

/// Reads the members of an edit; the caller reads further ones and finishes the object.
EditParams read_edit_members(ObjectReader& object) {
  JsonErrors& errors = object.errors();
  const std::size_t faults_before = errors.fault_count;
  EditParams edit;
  if (const Json* const level = object.required("level")) {
    constexpr std::uint64_t kMaxLevel = 255;  // what a frame's header holds; the surface has far fewer
    edit.level = static_cast<std::uint32_t>(
        read_integer(*level, object.pointer_to("level"), errors, 0, kMaxLevel).value_or(0));
  }
  if (const Json* const blend = object.optional("blend")) {
    if (const auto choice = read_choice(*blend, object.pointer_to("blend"), errors, kBlendNames)) {
      edit.blend = static_cast<Blend>(*choice);
    }
  }
  if (const Json* const deformation = object.required("deformation")) {
    edit.deformation = read_deformation(*deformation, object.pointer_to("deformation"), errors);
    if (errors.fault_count == faults_before)
      add_verdict(validate(edit.deformation), object.pointer(), errors);
  }
  if (const Json* const gains = object.optional("gains")) {
    const std::string place = object.pointer_to("gains");
    if (const Json* const array = read_array(*gains, place, errors, 1, kMaxBands)) {
      for (std::size_t i = 0; i < array->size(); ++i) {
        const auto gain = read_number((*array)[i], child_pointer(place, i), errors,
                                      {.min = double{-kGreatestGain}, .max = double{kGreatestGain}});
        edit.gains.push_back(static_cast<float>(gain.value_or(1.0)));
      }
    }
  }
  return edit;
}

template <typename T>
Parsed<T> value_or_errors(T value, JsonErrors errors) {
  if (!errors.empty()) return errors;
  return value;
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

Parsed<EditParams> parse_edit(const Json& document) {
  JsonErrors errors;
  ObjectReader object(document, "", errors);
  EditParams edit = read_edit_members(object);
  object.finish();
  return value_or_errors(std::move(edit), std::move(errors));
}

Parsed<PreviewRequest> parse_preview(const Json& document) {
  JsonErrors errors;
  ObjectReader object(document, "", errors);
  PreviewRequest request{.edit = read_edit_members(object)};
  if (const Json* const sequence = object.required("sequence")) {
    request.sequence =
        read_integer(*sequence, object.pointer_to("sequence"), errors, 1, kMaxSequence).value_or(0);
  }
  object.finish();
  return value_or_errors(std::move(request), std::move(errors));
}

Parsed<CreateSessionRequest> parse_create_session(const Json& document) {
  JsonErrors errors;
  CreateSessionRequest request;
  ObjectReader object(document, "", errors);
  if (const Json* const cloud = object.required("cloud")) {
    request.cloud = read_string(*cloud, "/cloud", errors).value_or("");
    if (cloud->is_string() && !is_valid_id(request.cloud)) errors.add("/cloud", "must be the id of a cloud");
  }
  if (const Json* const name = object.optional("name")) {
    request.name = read_string(*name, "/name", errors).value_or("");
    if (name->is_string() && !is_valid_name(request.name)) {
      errors.add("/name", "must be 1 to 120 bytes without control characters");
    }
  }
  if (const Json* const scales = object.optional("scales")) {
    if (const Json* const array = read_array(*scales, "/scales", errors, 1, kMaxBands)) {
      request.params.scales.clear();
      for (std::size_t i = 0; i < array->size(); ++i) {
        const auto scale =
            read_number((*array)[i], child_pointer("/scales", i), errors, {.min = 0.0, .max = 1.0});
        request.params.scales.push_back(static_cast<float>(scale.value_or(0.0)));
      }
    }
  }
  if (const Json* const neighbors = object.optional("neighbors")) {
    constexpr std::uint64_t kMaxNeighbors = 1000;  // the engine's own, tighter limit follows
    request.params.neighbors = static_cast<std::uint32_t>(
        read_integer(*neighbors, "/neighbors", errors, 0, kMaxNeighbors).value_or(0));
  }
  object.finish();
  if (errors.empty()) add_verdict(validate(request.params), "", errors);
  return value_or_errors(std::move(request), std::move(errors));
}

Parsed<HeadRequest> parse_head(const Json& document) {
  JsonErrors errors;
  HeadRequest request;
  ObjectReader object(document, "", errors);
  if (const Json* const edit = object.required("edit")) {
    constexpr std::uint64_t kMaxEdit = 0xFFFFFFFFU;
    request.edit = static_cast<std::uint32_t>(read_integer(*edit, "/edit", errors, 0, kMaxEdit).value_or(0));
  }
  object.finish();
  return value_or_errors(request, std::move(errors));
}

JsonDocument to_json(const Vec3d& vector) {
  return JsonDocument::array({vector.x(), vector.y(), vector.z()});
}

JsonDocument to_json(const Shape& shape) {
  JsonDocument document{{"type", kShapeNames[shape.index()]}};
  if (const auto* sphere = std::get_if<Sphere>(&shape)) {
    document["center"] = to_json(sphere->center);
    document["radius"] = sphere->radius;
  } else if (const auto* stroke = std::get_if<Stroke>(&shape)) {
    JsonDocument vertices = JsonDocument::array();
    for (const Vec3d& vertex : stroke->vertices) vertices.push_back(to_json(vertex));
    document["vertices"] = std::move(vertices);
    document["radius"] = stroke->radius;
  } else if (const auto* box = std::get_if<AxisBox>(&shape)) {
    document["min"] = to_json(box->min);
    document["max"] = to_json(box->max);
  } else if (const auto* half_space = std::get_if<HalfSpace>(&shape)) {
    document["point"] = to_json(half_space->point);
    document["normal"] = to_json(half_space->normal);
  }
  return document;
}

JsonDocument to_json(const PaintOperation& operation) {
  JsonDocument document{{"mode", kPaintModeNames[static_cast<std::size_t>(operation.mode)]},
                        {"shape", to_json(operation.shape)}};
  if (operation.facing) document["facing"] = to_json(*operation.facing);
  if (operation.steal) document["steal"] = true;
  return document;
}

namespace {

JsonDocument axis_to_json(const Vec3d& point, const Vec3d& direction) {
  return {{"point", to_json(point)}, {"direction", to_json(direction)}};
}

void put_members(const Translation& translation, JsonDocument& document) {
  document["vector"] = to_json(translation.vector);
}
void put_members(const NormalOffset& offset, JsonDocument& document) {
  document["distance"] = offset.distance;
}
void put_members(const TowardPoint& toward, JsonDocument& document) {
  document["target"] = to_json(toward.target);
  document["amount"] = toward.amount;
}
void put_members(const Rotation& rotation, JsonDocument& document) {
  document["axis"] = axis_to_json(rotation.point, rotation.axis);
  document["angle_deg"] = to_degrees(rotation.angle_rad);
}
void put_members(const Scaling& scaling, JsonDocument& document) {
  document["center"] = to_json(scaling.center);
  document["factors"] = to_json(scaling.factors);
}
void put_members(const Twist& twist, JsonDocument& document) {
  document["axis"] = axis_to_json(twist.point, twist.axis);
  document["angle_deg"] = to_degrees(twist.angle_rad);
  document["length"] = twist.length;
}

JsonDocument elementary_to_json(const ElementaryDeformation& one) {
  JsonDocument document{{"type", kDeformationNames[one.index()]}};
  std::visit([&](const auto& each) { put_members(each, document); }, one);
  return document;
}

}  // namespace

JsonDocument to_json(const Deformation& deformation) {
  if (deformation.steps.size() == 1) return elementary_to_json(deformation.steps.front());
  JsonDocument steps = JsonDocument::array();
  for (const ElementaryDeformation& one : deformation.steps) steps.push_back(elementary_to_json(one));
  return JsonDocument{{"type", kDeformationNames[kSequence]}, {"steps", std::move(steps)}};
}

JsonDocument to_json(const EditParams& edit) {
  JsonDocument document{
      {"level", edit.level}, {"blend", blend_name(edit.blend)}, {"deformation", to_json(edit.deformation)}};
  if (!edit.gains.empty()) document["gains"] = edit.gains;
  return document;
}

std::string_view blend_name(Blend blend) {
  return kBlendNames[static_cast<std::size_t>(blend)];
}

std::string_view region_name(RegionKind region) {
  return region == RegionKind::kZero ? "zero" : "one";
}

std::optional<RegionKind> region_of_name(std::string_view name) {
  if (name == "zero") return RegionKind::kZero;
  if (name == "one") return RegionKind::kOne;
  return std::nullopt;
}

std::string pointer_of_field(std::string_view field) {
  // The engine speaks of its own members; where the document of a deformation calls them otherwise, this says
  // so.
  constexpr std::array<std::array<std::string_view, 2>, 3> kRenamed{
      {{".axis", "/axis/direction"}, {".point", "/axis/point"}, {".angle_rad", "/angle_deg"}}};
  std::string_view renamed;
  if (field.starts_with("deformation")) {
    for (const auto& [engine, document] : kRenamed) {
      if (!field.ends_with(engine)) continue;
      field.remove_suffix(engine.size());
      renamed = document;
      break;
    }
  }
  std::string pointer;
  if (field.empty()) return pointer;
  pointer = "/";
  for (const char c : field) {
    if (c == '.' || c == '[') {
      pointer += '/';
    } else if (c != ']') {
      pointer += c;
    }
  }
  return pointer.append(renamed);
}

bool is_valid_name(std::string_view name) {
  constexpr std::size_t kMaxBytes = 120;
  if (name.empty() || name.size() > kMaxBytes) return false;
  for (std::size_t i = 0; i < name.size(); ++i) {
    const auto byte = static_cast<unsigned char>(name[i]);
    if (byte < 0x20 || byte == 0x7F) return false;
    const bool c1_control =
        byte == 0xC2 && i + 1 < name.size() && static_cast<unsigned char>(name[i + 1]) < 0xA0;
    if (c1_control) return false;
  }
  // The JSON library's own decoder is the judge of UTF-8: it prints nothing that is not.
  try {
    return !Json(std::string(name)).dump().empty();
  } catch (const Json::exception&) {
    return false;
  }
}

bool is_valid_id(std::string_view id) {
  constexpr std::size_t kIdLength = 22;
  const auto allowed = [](char c) {
    return (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '_' || c == '-';
  };
  return id.size() == kIdLength && std::all_of(id.begin(), id.end(), allowed);
}

double to_radians(double degrees) {
  return degrees * (std::numbers::pi / 180.0);
}

double to_degrees(double radians) {
  const double degrees = radians * (180.0 / std::numbers::pi);
  // The number that a person typed has few decimals; the nearest such one is it, if it leads back.
  const double typed = std::round(degrees * 1e9) / 1e9;
  if (to_radians(typed) == radians) return typed;
  double above = degrees;
  double below = degrees;
  for (int step = 0; step < 8; ++step) {
    if (to_radians(above) == radians) return above;
    if (to_radians(below) == radians) return below;
    above = std::nextafter(above, std::numeric_limits<double>::infinity());
    below = std::nextafter(below, -std::numeric_limits<double>::infinity());
  }
  return degrees;
}

}  // namespace pointwright::protocol

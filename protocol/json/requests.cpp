#include "protocol/json/requests.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <numbers>

#include "engine/multires/reconstruction.h"
#include "protocol/frames/frame.h"
#include "protocol/json/request_members.h"

namespace pointwright::protocol {
namespace {

// In the order of ElementaryDeformation; a composition of several comes last.
constexpr std::array<std::string_view, 7> kDeformationNames{
    "translation", "along_normal", "toward_point", "rotation", "scale", "twist", "sequence"};
constexpr std::size_t kSequence = kDeformationNames.size() - 1;
static_assert(std::variant_size_v<ElementaryDeformation> == kSequence);
constexpr std::array<std::string_view, 4> kBlendNames{"quartic", "cubic", "quintic", "cosine"};

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

/// Members that are not there keep their defaults.
ResamplingParams read_resampling(const Json& value, const std::string& pointer, JsonErrors& errors) {
  constexpr std::uint64_t kMostCreated = 0xFFFFFFFFU;
  constexpr std::uint64_t kMostSweeps = 1000;  // the engine's own, tighter limit follows
  ObjectReader object(value, pointer, errors);
  ResamplingParams params;
  for (const auto& [name, number] :
       {std::pair("bound", &params.bound), std::pair("min_spacing", &params.min_spacing),
        std::pair("collect", &params.collect)}) {
    if (const Json* const member = object.optional(name))
      *number = read_number(*member, object.pointer_to(name), errors).value_or(*number);
  }
  if (const Json* const member = object.optional("max_samples"))
    params.max_samples = static_cast<std::uint32_t>(
        read_integer(*member, object.pointer_to("max_samples"), errors, 0, kMostCreated).value_or(0));
  if (const Json* const member = object.optional("shear_aware"))
    params.shear_aware = read_bool(*member, object.pointer_to("shear_aware"), errors).value_or(false);
  if (const Json* const member = object.optional("sweeps"))
    params.sweeps = static_cast<std::uint32_t>(
        read_integer(*member, object.pointer_to("sweeps"), errors, 0, kMostSweeps).value_or(0));
  object.finish();
  return params;
}

/// The engine's verdict. Of a single step it speaks as of the deformation itself, of a document's sequence of
/// one it must not.
Result<void> verdict_of(const Deformation& deformation, bool is_sequence) {
  auto verdict = validate(deformation);
  if (verdict || !is_sequence || deformation.steps.size() != 1) return verdict;
  Error error = verdict.error();
  error.field.replace(0, std::string_view("deformation").size(), "deformation.steps[0]");
  return error;
}

}  // namespace

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
      add_verdict(verdict_of(edit.deformation, deformation->contains("steps")), object.pointer(), errors);
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
  if (const Json* const resampling = object.optional("resampling")) {
    const std::size_t before = errors.fault_count;
    edit.resampling = read_resampling(*resampling, object.pointer_to("resampling"), errors);
    if (errors.fault_count == before) add_verdict(validate(*edit.resampling), object.pointer(), errors);
  }
  return edit;
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

namespace {

/// The member /name.
std::string read_name(const Json& value, JsonErrors& errors) {
  std::string name = read_string(value, "/name", errors).value_or("");
  if (value.is_string() && !is_valid_name(name))
    errors.add("/name", "must be 1 to 120 bytes without control characters");
  return name;
}

}  // namespace

Parsed<ImportCloudRequest> parse_import_cloud(const Json& document) {
  JsonErrors errors;
  ImportCloudRequest request;
  ObjectReader object(document, "", errors);
  request.upload = required_id(object, "upload", "an upload");
  if (const Json* const name = object.optional("name")) request.name = read_name(*name, errors);
  if (const Json* const policy = object.optional("nonfinite")) {
    constexpr std::array<std::string_view, 2> kPolicies{"reject", "drop"};
    request.drop_non_finite = read_choice(*policy, "/nonfinite", errors, kPolicies).value_or(0) == 1;
  }
  if (const Json* const format = object.optional("format")) {
    std::array<std::string_view, static_cast<std::size_t>(kLastCloudFormat) + 1> names;
    for (std::size_t i = 0; i < names.size(); ++i) names.at(i) = format_name(static_cast<CloudFormat>(i));
    if (const auto choice = read_choice(*format, "/format", errors, names))
      request.format = static_cast<CloudFormat>(*choice);
  }
  object.finish();
  return value_or_errors(std::move(request), std::move(errors));
}

Parsed<CreateSessionRequest> parse_create_session(const Json& document) {
  JsonErrors errors;
  CreateSessionRequest request;
  ObjectReader object(document, "", errors);
  request.cloud = required_id(object, "cloud", "a cloud");
  if (const Json* const name = object.optional("name")) request.name = read_name(*name, errors);
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
  if (const Json* const preview = object.optional("preview")) {
    constexpr std::uint64_t kMaxCount = 0xFFFFFFFFU;
    ObjectReader members(*preview, "/preview", errors);
    if (const Json* const count = members.required("count"))
      request.preview = read_integer(*count, "/preview/count", errors, 1, kMaxCount);
    members.finish();
  }
  object.finish();
  if (errors.empty()) add_verdict(validate(request.params), "", errors);
  return value_or_errors(std::move(request), std::move(errors));
}

Parsed<SessionChange> parse_session_change(const Json& document) {
  JsonErrors errors;
  SessionChange change;
  ObjectReader object(document, "", errors);
  if (const Json* const name = object.required("name")) change.name = read_name(*name, errors);
  object.finish();
  return value_or_errors(std::move(change), std::move(errors));
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

namespace {

/// The number with the fewest digits that is this float: 0.1, not 0.10000000149.
double shortest(float value) {
  std::array<char, 32> text{};
  const auto end = std::to_chars(text.data(), text.data() + text.size(), value).ptr;
  double number = 0.0;
  std::from_chars(text.data(), end, number);
  return number;
}

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

JsonDocument to_json(const ResamplingParams& resampling) {
  return {{"bound", resampling.bound},
          {"min_spacing", resampling.min_spacing},
          {"max_samples", resampling.max_samples},
          {"shear_aware", resampling.shear_aware},
          {"sweeps", resampling.sweeps},
          {"collect", resampling.collect}};
}

JsonDocument to_json(const EditParams& edit) {
  JsonDocument document{
      {"level", edit.level}, {"blend", blend_name(edit.blend)}, {"deformation", to_json(edit.deformation)}};
  for (const float gain : edit.gains) document["gains"].push_back(shortest(gain));
  if (edit.resampling) document["resampling"] = to_json(*edit.resampling);
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

bool is_valid_region_name(std::string_view name) {
  constexpr std::size_t kMaxBytes = 64;
  constexpr std::array<std::string_view, 5> kReserved{"zero", "one", "t", ".", ".."};
  const auto allowed = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' ||
           c == ' ' || c == '.' || c == '-';
  };
  return !name.empty() && name.size() <= kMaxBytes && std::ranges::all_of(name, allowed) &&
         std::ranges::find(kReserved, name) == kReserved.end();
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

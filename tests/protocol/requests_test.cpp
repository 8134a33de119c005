#include "protocol/json/requests.h"

#include <doctest/doctest.h>

#include <numbers>
#include <random>

#include "tests/protocol/request_checks.h"

using namespace pointwright;
using namespace pointwright::protocol;
using namespace pointwright::test;

namespace {

constexpr const char* kId = "Jq3cT9rVwXyZ0a1b2c3d4e";

}  // namespace

TEST_CASE("paint operations are read with every shape and mode") {
  const auto sphere = accepted(R"({"mode":"add","shape":{"type":"sphere","center":[1,2,3],"radius":0.5}})",
                               parse_paint_operation);
  CHECK(sphere.mode == PaintMode::kAdd);
  CHECK(std::get<Sphere>(sphere.shape).center == Vec3d(1, 2, 3));
  CHECK(std::get<Sphere>(sphere.shape).radius == 0.5);
  CHECK_FALSE(sphere.facing.has_value());
  CHECK_FALSE(sphere.steal);
  const auto stroke = accepted(
      R"({"mode":"remove","shape":{"type":"stroke","vertices":[[0,0,0],[1,0,0]],"radius":1},"facing":[0,0,2],"steal":true})",
      parse_paint_operation);
  CHECK(stroke.mode == PaintMode::kRemove);
  CHECK(std::get<Stroke>(stroke.shape).vertices.size() == 2);
  CHECK(stroke.facing == Vec3d(0, 0, 2));
  CHECK(stroke.steal);
  const auto box = accepted(R"({"mode":"intersect","shape":{"type":"box","min":[0,0,0],"max":[1,1,1]}})",
                            parse_paint_operation);
  CHECK(box.mode == PaintMode::kIntersect);
  CHECK(std::get<AxisBox>(box.shape).max == Vec3d(1, 1, 1));
  const auto half =
      accepted(R"({"mode":"set","shape":{"type":"half_space","point":[0,0,1],"normal":[0,1,0]}})",
               parse_paint_operation);
  CHECK(half.mode == PaintMode::kSet);
  CHECK(std::get<HalfSpace>(half.shape).normal == Vec3d(0, 1, 0));
  CHECK(std::holds_alternative<Everything>(
      accepted(R"({"mode":"set","shape":{"type":"all"}})", parse_paint_operation).shape));
}

TEST_CASE("whatever is wrong with a paint operation is pointed at") {
  CHECK(refused("[]", parse_paint_operation) == Pointers{""});
  CHECK(refused("{}", parse_paint_operation) == Pointers{"/mode"});
  CHECK(refused(R"({"mode":"set"})", parse_paint_operation) == Pointers{"/shape"});
  CHECK(refused(R"({"mode":"blur","shape":{"type":"all"}})", parse_paint_operation) == Pointers{"/mode"});
  CHECK(refused(R"({"mode":"add","shape":{"type":"cone"}})", parse_paint_operation) ==
        Pointers{"/shape/type"});
  CHECK(refused(R"({"mode":"add","shape":{"type":"sphere","center":[1,2],"radius":true}})",
                parse_paint_operation) == Pointers{"/shape/center", "/shape/radius"});
  CHECK(refused(R"({"mode":"add","shape":{"type":"sphere","center":[1,2,"3"],"radius":1}})",
                parse_paint_operation) == Pointers{"/shape/center/2"});
  CHECK(refused(R"({"mode":"add","shape":{"type":"all","radius":1}})", parse_paint_operation) ==
        Pointers{"/shape/radius"});
  CHECK(refused(R"({"mode":"add","shape":{"type":"all"},"steal":1,"colour":2})", parse_paint_operation) ==
        Pointers{"/steal", "/colour"});
  CHECK(refused(R"({"mode":"add","shape":{"type":"all"},"facing":null})", parse_paint_operation) ==
        Pointers{"/facing"});
  CHECK(refused(R"({"mode":"add","shape":{"type":"stroke","vertices":[],"radius":1}})",
                parse_paint_operation) == Pointers{"/shape/vertices"});
}

TEST_CASE("operations without a shape have their own members, and no others") {
  CHECK(accepted(R"({"mode":"invert","steal":true})", parse_paint_operation).steal);
  CHECK(accepted(R"({"mode":"clear"})", parse_paint_operation).mode == PaintMode::kClear);
  CHECK(accepted(R"({"mode":"grow","distance":0.5})", parse_paint_operation).distance == 0.5);
  CHECK(refused(R"({"mode":"invert","shape":{"type":"all"},"distance":1})", parse_paint_operation) ==
        Pointers{"/distance", "/shape"});
  CHECK(refused(R"({"mode":"clear","facing":[0,0,1]})", parse_paint_operation) == Pointers{"/facing"});
  CHECK(refused(R"({"mode":"add","shape":{"type":"all"},"distance":1})", parse_paint_operation) ==
        Pointers{"/distance"});
  CHECK(refused(R"({"mode":"grow"})", parse_paint_operation) == Pointers{"/distance"});
  CHECK(refused(R"({"mode":"shrink","distance":"1"})", parse_paint_operation) == Pointers{"/distance"});
  CHECK(refused(R"({"mode":"shrink","distance":0})", parse_paint_operation) == Pointers{"/distance"});
  CHECK(refused(R"({"mode":"shrink","distance":1e13})", parse_paint_operation) == Pointers{"/distance"});
}

TEST_CASE("points have one radius or one each") {
  const auto points = [](const std::string& members) {
    return R"({"mode":"add","shape":{"type":"points",)" + members + "}}";
  };
  const auto one = accepted(points(R"("points":[[0,0,0],[1,2,3]],"radius":0.5)"), parse_paint_operation);
  CHECK(std::get<PointSet>(one.shape).points[1] == Vec3d(1, 2, 3));
  CHECK(std::get<PointSet>(one.shape).radii == std::vector<double>{0.5});
  const auto each =
      accepted(points(R"("points":[[0,0,0],[1,2,3]],"radii":[0.5,0.25])"), parse_paint_operation);
  CHECK(std::get<PointSet>(each.shape).radii == std::vector<double>{0.5, 0.25});
  const auto faults = [&](const std::string& members) {
    return refused(points(members), parse_paint_operation);
  };
  CHECK(faults(R"("points":[[0,0,0]])") == Pointers{"/shape/radius"});
  CHECK(faults(R"("points":[[0,0,0]],"radius":1,"radii":[1])") == Pointers{"/shape/radius"});
  CHECK(faults(R"("points":[[0,0,0]],"radii":[1,2])") == Pointers{"/shape/radii"});
  CHECK(faults(R"("points":[[0,0,0]],"radii":[true])") == Pointers{"/shape/radii/0"});
  CHECK(faults(R"("points":[[0,0,0]],"radii":[-1])") == Pointers{"/shape/radius"});
  CHECK(faults(R"("points":[[0,0,0],[0,0,0]],"radii":[1,-1])") == Pointers{"/shape/radii"});
  CHECK(faults(R"("points":[],"radius":1)") == Pointers{"/shape/points"});
  CHECK(faults(R"("points":[[0,0]],"radius":1)") == Pointers{"/shape/points/0"});
}

TEST_CASE("screen shapes have a view of 16 numbers and one outline") {
  const std::string view = R"("view":[1,0,0,0,0,1,0,0,0,0,1,0,0,0,-1,5])";
  const auto faults = [](const std::string& members) {
    return refused(R"({"mode":"add","shape":{"type":"screen",)" + members + "}}", parse_paint_operation);
  };
  const auto with = [&](const std::string& outline) { return faults(view + R"(,"outline":)" + outline); };
  const auto read =
      accepted(R"({"mode":"set","shape":{"type":"screen",)" + view +
                   R"(,"outline":{"type":"polyline","vertices":[[0,0.5],[1,2]],"width":0.25}}})",
               parse_paint_operation);
  const auto& screen = std::get<ScreenShape>(read.shape);
  CHECK(screen.view[14] == -1.0);
  CHECK(screen.view[15] == 5.0);
  CHECK(std::get<ScreenPolyline>(screen.outline).vertices[1] == Vec2d(1, 2));
  CHECK(std::get<ScreenPolyline>(screen.outline).width == 0.25);
  CHECK_FALSE(screen.visible);
  const std::string ellipse = R"(,"outline":{"type":"ellipse","center":[0,0],"half_axes":[1,1]})";
  const auto seen =
      accepted(R"({"mode":"set","shape":{"type":"screen",)" + view + ellipse + R"(,"visible":true}})",
               parse_paint_operation);
  CHECK(std::get<ScreenShape>(seen.shape).visible);
  CHECK(faults(view + ellipse + R"(,"visible":1)") == Pointers{"/shape/visible"});
  CHECK(faults(view) == Pointers{"/shape/outline"});
  CHECK(faults(R"("view":[1,2],"outline":{"type":"ellipse","center":[0,0],"half_axes":[1,1]})") ==
        Pointers{"/shape/view"});
  CHECK(with(R"({"type":"blob"})") == Pointers{"/shape/outline/type"});
  CHECK(with(R"({"type":"polygon","vertices":[[0,0],[1,1]]})") == Pointers{"/shape/outline/vertices"});
  CHECK(with(R"({"type":"polygon","vertices":[[0,0],[1,1],[1]]})") == Pointers{"/shape/outline/vertices/2"});
  CHECK(with(R"({"type":"polygon","vertices":[[0,0],[1,1],[1,null]]})") ==
        Pointers{"/shape/outline/vertices/2/1"});
  CHECK(with(R"({"type":"ellipse","center":[0,0],"half_axes":[1,0]})") ==
        Pointers{"/shape/outline/half_axes"});
  CHECK(with(R"({"type":"polyline","vertices":[[0,0]],"width":-1})") == Pointers{"/shape/outline/width"});
  CHECK(with(R"({"type":"ellipse","center":[0,0],"half_axes":[1,1],"width":1})") ==
        Pointers{"/shape/outline/width"});
  CHECK(
      refused(
          R"({"mode":"add","shape":{"type":"screen","view":[1,0,0,0,0,1,0,0,0,0,1,0,0,0,0,0],"outline":{"type":"ellipse","center":[0,0],"half_axes":[1,1]}}})",
          parse_paint_operation) == Pointers{"/shape/view"});
}

TEST_CASE("images have a projection, and defaults for everything else") {
  const std::string id = std::string(R"("image":")") + kId + "\"";
  const auto shape = [](const std::string& members) {
    return R"({"mode":"add","shape":{"type":"image",)" + members + "}}";
  };
  const auto plain = accepted(shape(id + R"(,"projection":{"type":"texture"})"), parse_paint_operation);
  const auto& texture = std::get<ImageShape>(plain.shape);
  CHECK(texture.source == kId);
  CHECK(texture.image == nullptr);
  CHECK(texture.channel == ImageChannel::kLuminance);
  CHECK(texture.threshold == 0.5);
  CHECK(texture.above);
  CHECK_FALSE(std::get<TextureProjection>(texture.projection).repeat);
  const auto full =
      accepted(shape(id + R"(,"channel":"alpha","threshold":1,"side":"below","projection":{"type":"planar",)"
                          R"("origin":[1,2,3],"u":[1,0,0],"v":[1,1,0],"depth":[-1,2]})"),
               parse_paint_operation);
  const auto& planar = std::get<ImageShape>(full.shape);
  CHECK(planar.channel == ImageChannel::kAlpha);
  CHECK(planar.threshold == 1.0);
  CHECK_FALSE(planar.above);
  const auto& plane = std::get<PlanarProjection>(planar.projection);
  CHECK(plane.origin == Vec3d(1, 2, 3));
  CHECK(plane.v == Vec3d(1, 1, 0));
  REQUIRE(plane.depth.has_value());
  CHECK((*plane.depth)[1] == 2.0);
  const auto faults = [&](const std::string& members) {
    return refused(shape(members), parse_paint_operation);
  };
  const std::string by_texture = R"(,"projection":{"type":"texture"})";
  CHECK(faults(R"("projection":{"type":"texture"})") == Pointers{"/shape/image"});
  CHECK(faults(R"("image":"nobody")" + by_texture) == Pointers{"/shape/image"});
  CHECK(faults(id) == Pointers{"/shape/projection"});
  CHECK(faults(id + R"(,"projection":{"type":"sphere"})") == Pointers{"/shape/projection/type"});
  CHECK(faults(id + R"(,"projection":{"type":"texture","u":[1,0,0]})") == Pointers{"/shape/projection/u"});
  CHECK(faults(id + R"(,"projection":{"type":"texture","repeat":1})") ==
        Pointers{"/shape/projection/repeat"});
  CHECK(faults(id + by_texture + R"(,"channel":"hue")") == Pointers{"/shape/channel"});
  CHECK(faults(id + by_texture + R"(,"side":"left")") == Pointers{"/shape/side"});
  CHECK(faults(id + by_texture + R"(,"threshold":1.5)") == Pointers{"/shape/threshold"});
  const auto planar_faults = [&](const std::string& members) {
    return faults(id + R"(,"projection":{"type":"planar",)" + members + "}");
  };
  CHECK(planar_faults(R"("origin":[0,0,0],"u":[1,0,0])") == Pointers{"/shape/projection/v"});
  CHECK(planar_faults(R"("origin":[0,0,0],"u":[1,0,0],"v":[2,0,0])") == Pointers{"/shape/projection/v"});
  CHECK(planar_faults(R"("origin":[0,0,0],"u":[0,0,0],"v":[2,0,0])") == Pointers{"/shape/projection/u"});
  CHECK(planar_faults(R"("origin":[0,0,0],"u":[1,0,0],"v":[0,1,0],"depth":[1])") ==
        Pointers{"/shape/projection/depth"});
  CHECK(planar_faults(R"("origin":[0,0,0],"u":[1,0,0],"v":[0,1,0],"depth":[2,1])") ==
        Pointers{"/shape/projection/depth"});
}

TEST_CASE("models have a cloud, an affine matrix and a thickness") {
  const auto shape = [](const std::string& members) {
    return R"({"mode":"add","shape":{"type":"model",)" + members + "}}";
  };
  const std::string id = std::string(R"("cloud":")") + kId + "\"";
  const std::string matrix = R"(,"matrix":[0,-1,0,5,1,0,0,6,0,0,2,7,0,0,0,1])";
  const auto read = accepted(shape(id + matrix + R"(,"thickness":0.25)"), parse_paint_operation);
  const auto& model = std::get<ModelShape>(read.shape);
  CHECK(model.source == kId);
  CHECK(model.cloud == nullptr);
  CHECK(model.matrix[1] == -1.0);
  CHECK(model.matrix[11] == 7.0);
  CHECK(model.thickness == 0.25);
  const auto faults = [&](const std::string& members) {
    return refused(shape(members), parse_paint_operation);
  };
  CHECK(faults(id + matrix) == Pointers{"/shape/thickness"});
  CHECK(faults(id + matrix + R"(,"thickness":0)") == Pointers{"/shape/thickness"});
  CHECK(faults(R"("cloud":7)" + matrix + R"(,"thickness":1)") == Pointers{"/shape/cloud"});
  CHECK(faults(id + R"(,"matrix":[1,0,0],"thickness":1)") == Pointers{"/shape/matrix"});
  CHECK(faults(id + R"(,"matrix":[1,0,0,0,0,1,0,0,0,0,1,0,0,0,0.5,1],"thickness":1)") ==
        Pointers{"/shape/matrix"});
  CHECK(faults(id + R"(,"matrix":[1,0,0,0,0,1,0,0,1,1,0,0,0,0,0,1],"thickness":1)") ==
        Pointers{"/shape/matrix"});
}

TEST_CASE("floods have a seed and any bounds") {
  const auto all = accepted(
      R"({"mode":"flood","seed":[1,2,3],"angle_deg":90,"radius":0.5,"stop_at_other":true,"steal":true})",
      parse_paint_operation);
  CHECK(all.flood.seed == Vec3d(1, 2, 3));
  CHECK(all.flood.angle_rad == std::numbers::pi / 2);
  CHECK(all.flood.radius == 0.5);
  CHECK(all.flood.stop_at_other);
  CHECK(all.steal);
  const auto none = accepted(R"({"mode":"flood","seed":[1,2,3]})", parse_paint_operation);
  CHECK_FALSE(none.flood.angle_rad.has_value());
  CHECK_FALSE(none.flood.radius.has_value());
  CHECK_FALSE(none.flood.stop_at_other);
  CHECK(accepted(R"({"mode":"flood","seed":[1,2,3],"angle_deg":180})", parse_paint_operation)
            .flood.angle_rad.has_value());
  const auto faults = [](const std::string& members) {
    return refused(R"({"mode":"flood")" + members + "}", parse_paint_operation);
  };
  CHECK(faults("") == Pointers{"/seed"});
  CHECK(faults(R"(,"seed":[1,2])") == Pointers{"/seed"});
  CHECK(faults(R"(,"seed":[1,2,1e13])") == Pointers{"/seed"});
  CHECK(faults(R"(,"seed":[1,2,3],"angle_deg":180.5)") == Pointers{"/angle_deg"});
  CHECK(faults(R"(,"seed":[1,2,3],"angle_deg":null)") == Pointers{"/angle_deg"});
  CHECK(faults(R"(,"seed":[1,2,3],"radius":0)") == Pointers{"/radius"});
  CHECK(faults(R"(,"seed":[1,2,3],"stop_at_other":1)") == Pointers{"/stop_at_other"});
  CHECK(faults(R"(,"seed":[1,2,3],"shape":{"type":"all"})") == Pointers{"/shape"});
}

TEST_CASE("the engine's verdict on values comes back with the document's pointer") {
  CHECK(refused(R"({"mode":"add","shape":{"type":"sphere","center":[0,0,0],"radius":0}})",
                parse_paint_operation) == Pointers{"/shape/radius"});
  CHECK(refused(R"({"mode":"add","shape":{"type":"all"},"facing":[0,0,0]})", parse_paint_operation) ==
        Pointers{"/facing"});
  CHECK(refused(R"({"operations":[{"mode":"add","shape":{"type":"all"}},
                  {"mode":"add","shape":{"type":"sphere","center":[0,0,0],"radius":-1}}]})",
                parse_painting) == Pointers{"/operations/1/shape/radius"});
  CHECK(
      refused(
          R"({"level":0,"deformation":{"type":"rotation","axis":{"point":[0,0,0],"direction":[0,0,0]},"angle_deg":1}})",
          parse_edit) == Pointers{"/deformation/axis/direction"});
  CHECK(
      refused(
          R"({"level":0,"deformation":{"type":"rotation","axis":{"point":[0,0,0],"direction":[0,0,1]},"angle_deg":1e9}})",
          parse_edit) == Pointers{"/deformation/angle_deg"});
}

TEST_CASE("a painting is a list of operations, also an empty one, with a limit") {
  CHECK(accepted(R"({"operations":[]})", parse_painting).empty());
  CHECK(accepted(R"({"operations":[{"mode":"set","shape":{"type":"all"}}]})", parse_painting).size() == 1);
  CHECK(refused(R"({"operations":{}})", parse_painting) == Pointers{"/operations"});
  CHECK(refused(R"({"operations":[],"region":"zero"})", parse_painting) == Pointers{"/region"});
  std::string many = R"({"operations":[)";
  for (std::size_t i = 0; i <= kMaxPaintOperations; ++i) {
    many += std::string(i == 0 ? "" : ",") + R"({"mode":"set","shape":{"type":"all"}})";
  }
  CHECK(refused(many + "]}", parse_painting) == Pointers{"/operations"});
}

TEST_CASE("edits are read, degrees become radians") {
  const auto edit = accepted(
      R"({"level":1,"blend":"quartic","deformation":{"type":"rotation","axis":{"point":[1,2,3],"direction":[0,0,2]},"angle_deg":-90}})",
      parse_edit);
  CHECK(edit.level == 1);
  CHECK(edit.blend == Blend::kQuartic);
  REQUIRE(edit.deformation.steps.size() == 1);
  const auto& rotation = std::get<Rotation>(edit.deformation.steps[0]);
  CHECK(rotation.point == Vec3d(1, 2, 3));
  CHECK(rotation.axis == Vec3d(0, 0, 2));
  CHECK(rotation.angle_rad == -std::numbers::pi / 2);
  CHECK(accepted(R"({"level":0,"deformation":{"type":"translation","vector":[0,0,0]}})", parse_edit).level ==
        0);
}

TEST_CASE("every kind of deformation is read, checked and written back to the bit") {
  const std::vector<std::string> documents = {
      R"({"type":"translation","vector":[0.1,2.0,-3.0]})",
      R"({"type":"along_normal","distance":-0.25})",
      R"({"type":"toward_point","target":[1.0,2.0,3.0],"amount":0.5})",
      R"({"type":"rotation","axis":{"point":[1.0,2.0,3.0],"direction":[0.0,0.0,2.0]},"angle_deg":33.3})",
      R"({"type":"scale","center":[1.0,0.0,0.0],"factors":[1.0,2.0,0.5]})",
      R"({"type":"twist","axis":{"point":[0.0,0.0,0.0],"direction":[0.0,1.0,0.0]},"angle_deg":360.0,"length":0.2})",
      R"({"type":"sequence","steps":[{"type":"along_normal","distance":0.1},{"type":"translation","vector":[0.0,0.0,1.0]}]})"};
  for (const std::string& document : documents) {
    CAPTURE(document);
    const auto edit = accepted(
        R"({"level":0,"blend":"cosine","deformation":)" + document + R"(,"gains":[0.5,2.0]})", parse_edit);
    CHECK(to_json(edit.deformation).dump() == document);
    CHECK(edit.blend == Blend::kCosine);
    CHECK(edit.gains == std::vector<float>{0.5F, 2.0F});
    CHECK(accepted(to_json(edit).dump(), parse_edit) == edit);
  }
  const auto faults = [](const std::string& deformation) {
    return refused(R"({"level":0,"deformation":)" + deformation + "}", parse_edit);
  };
  CHECK(faults(R"({"type":"bend"})") == Pointers{"/deformation/type"});
  CHECK(faults(R"({"type":"scale","center":[0,0,0],"factors":[0,1,1]})") == Pointers{"/deformation/factors"});
  CHECK(faults(R"({"type":"twist","axis":{"point":[0,0,0],"direction":[0,0,0]},"angle_deg":1,"length":1})") ==
        Pointers{"/deformation/axis/direction"});
  CHECK(faults(R"({"type":"sequence","steps":[]})") == Pointers{"/deformation/steps"});
  CHECK(faults(R"({"type":"sequence","steps":[{"type":"scale","center":[0,0,0],"factors":[0,1,1]}]})") ==
        Pointers{"/deformation/steps/0/factors"});
  const auto tenth =
      accepted(R"({"level":0,"deformation":{"type":"along_normal","distance":1},"gains":[0.1]})", parse_edit);
  CHECK(to_json(tenth)["gains"].dump() == "[0.1]");
  CHECK(faults(R"({"type":"sequence","steps":[{"type":"sequence","steps":[]}]})") ==
        Pointers{"/deformation/steps/0/type"});
  CHECK(
      faults(
          R"({"type":"sequence","steps":[{"type":"translation","vector":[0,0,0]},{"type":"rotation","axis":{"point":[0,0,0],"direction":[0,0,1]},"angle_deg":99999}]})") ==
      Pointers{"/deformation/steps/1/angle_deg"});
  CHECK(
      faults(
          R"({"type":"sequence","steps":[{"type":"translation","vector":[0,0,0]},{"type":"along_normal","distance":1}]})") ==
      Pointers{"/deformation/steps/1/type"});
  CHECK(refused(R"({"level":0,"deformation":{"type":"along_normal","distance":1},"gains":[17]})",
                parse_edit) == Pointers{"/gains/0"});
}

TEST_CASE("resampling has defaults, limits and nothing else") {
  const auto edit_with = [](const std::string& resampling) {
    return R"({"level":0,"deformation":{"type":"translation","vector":[0,0,1]},"resampling":)" + resampling +
           "}";
  };
  CHECK(accepted(edit_with("{}"), parse_edit).resampling == ResamplingParams{});
  CHECK_FALSE(accepted(R"({"level":0,"deformation":{"type":"translation","vector":[0,0,1]}})", parse_edit)
                  .resampling.has_value());
  const std::string full =
      R"({"bound":1.05,"min_spacing":0.25,"max_samples":4294967295,"shear_aware":true,"sweeps":64,"collect":0.9})";
  const auto edit = accepted(edit_with(full), parse_edit);
  CHECK(edit.resampling == ResamplingParams{.bound = 1.05,
                                            .min_spacing = 0.25,
                                            .max_samples = 4294967295U,
                                            .shear_aware = true,
                                            .sweeps = 64,
                                            .collect = 0.9});
  CHECK(to_json(*edit.resampling).dump() == full);
  CHECK(accepted(to_json(edit).dump(), parse_edit) == edit);
  const auto faults = [&](const std::string& resampling) {
    const Pointers of_edit = refused(edit_with(resampling), parse_edit);
    std::string preview = edit_with(resampling);
    preview.insert(1, R"("sequence":1,)");
    CHECK(refused(preview, parse_preview) == of_edit);
    return of_edit;
  };
  for (const char* value : {"null", "1.5", "[]", "true"}) CHECK(faults(value) == Pointers{"/resampling"});
  for (const char* bound : {"1.0", "16.5", "\"2\"", "null", "-1", "true"})
    CHECK(faults(R"({"bound":)" + std::string(bound) + "}") == Pointers{"/resampling/bound"});
  for (const char* spacing : {"-0.1", "1e10", "null"})
    CHECK(faults(R"({"min_spacing":)" + std::string(spacing) + "}") == Pointers{"/resampling/min_spacing"});
  for (const char* most : {"-1", "0.5", "4294967296", "true"})
    CHECK(faults(R"({"max_samples":)" + std::string(most) + "}") == Pointers{"/resampling/max_samples"});
  for (const char* sweeps : {"-1", "65", "1e9", "0.5"})
    CHECK(faults(R"({"sweeps":)" + std::string(sweeps) + "}") == Pointers{"/resampling/sweeps"});
  for (const char* collect : {"-0.1", "0.95", "null"})
    CHECK(faults(R"({"collect":)" + std::string(collect) + "}") == Pointers{"/resampling/collect"});
  CHECK(faults(R"({"shear_aware":1})") == Pointers{"/resampling/shear_aware"});
  CHECK(faults(R"({"limit":1})") == Pointers{"/resampling/limit"});
}

TEST_CASE("levels, sequences and heads are whole numbers in range") {
  const std::string rest = R"(,"deformation":{"type":"translation","vector":[0,0,1]}})";
  for (const char* level :
       {"-1", "1.9", "true", "\"0\"", "null", "256", "4294967296", "1e300", "18446744073709551615"}) {
    CHECK(refused(R"({"level":)" + std::string(level) + rest, parse_edit) == Pointers{"/level"});
    CHECK(refused(R"({"sequence":1,"level":)" + std::string(level) + rest, parse_preview) ==
          Pointers{"/level"});
  }
  for (const char* sequence : {"0", "-1", "0.5", "9007199254740992", "true"}) {
    CHECK(refused(R"({"level":0,"sequence":)" + std::string(sequence) + rest, parse_preview) ==
          Pointers{"/sequence"});
  }
  CHECK(accepted(R"({"level":0,"sequence":9007199254740991)" + rest, parse_preview).sequence ==
        9007199254740991U);
  CHECK(refused(R"({"level":0)" + rest, parse_preview) == Pointers{"/sequence"});
  CHECK(refused(R"({"level":0,"sequence":1)" + rest, parse_edit) == Pointers{"/sequence"});
  CHECK(accepted(R"({"edit":4294967295})", parse_head).edit == 4294967295U);
  for (const char* edit : {"-1", "4294967296", "0.1", "null"}) {
    CHECK(refused(R"({"edit":)" + std::string(edit) + "}", parse_head) == Pointers{"/edit"});
  }
}

TEST_CASE("a session names its cloud; the rest has defaults") {
  const std::string cloud = R"({"cloud":")" + std::string(kId) + '"';
  const auto plain = accepted(cloud + "}", parse_create_session);
  CHECK(plain.cloud == kId);
  CHECK(plain.name.empty());
  CHECK(plain.params == HierarchyParams{});
  const auto full =
      accepted(cloud + R"(,"name":"Wings","scales":[0.05],"neighbors":12})", parse_create_session);
  CHECK(full.name == "Wings");
  CHECK(full.params.scales == std::vector<float>{0.05F});
  CHECK(full.params.neighbors == 12);
  CHECK_FALSE(plain.preview.has_value());
  CHECK(accepted(cloud + R"(,"preview":{"count":5000}})", parse_create_session).preview == 5000U);
  CHECK(accepted(cloud + R"(,"preview":{"count":4294967295}})", parse_create_session).preview == 4294967295U);
  for (const char* count : {"0", "-1", "1.5", "4294967296", "\"5\"", "null"})
    CHECK(refused(cloud + R"(,"preview":{"count":)" + count + "}}", parse_create_session) ==
          Pointers{"/preview/count"});
  CHECK(refused(cloud + R"(,"preview":{}})", parse_create_session) == Pointers{"/preview/count"});
  CHECK(refused(cloud + R"(,"preview":{"count":5,"of":9}})", parse_create_session) ==
        Pointers{"/preview/of"});

  CHECK(refused(R"({"cloud":"short"})", parse_create_session) == Pointers{"/cloud"});
  CHECK(refused(R"({"cloud":7})", parse_create_session) == Pointers{"/cloud"});
  CHECK(refused(cloud + R"(,"name":""})", parse_create_session) == Pointers{"/name"});
  CHECK(refused(cloud + R"(,"scales":[]})", parse_create_session) == Pointers{"/scales"});
  CHECK(refused(cloud + R"(,"scales":0.02})", parse_create_session) == Pointers{"/scales"});
  CHECK(refused(cloud + R"(,"scales":["a"]})", parse_create_session) == Pointers{"/scales/0"});
  CHECK(refused(cloud + R"(,"scales":[1e300]})", parse_create_session) == Pointers{"/scales/0"});
  CHECK(refused(cloud + R"(,"neighbors":3})", parse_create_session) == Pointers{"/neighbors"});
  CHECK(refused(cloud + R"(,"neighbors":9.5})", parse_create_session) == Pointers{"/neighbors"});
  CHECK(refused(cloud + R"(,"preview":true})", parse_create_session) == Pointers{"/preview"});
  CHECK(refused(cloud + R"(,"scales":[0.3]})", parse_create_session).size() == 1);
  CHECK(refused(cloud + R"(,"scales":[0.02,0.05]})", parse_create_session).size() == 1);
  CHECK(refused(cloud + R"(,"scales":[0.2,0.15,0.1,0.08,0.06,0.04,0.03,0.02,0.01]})", parse_create_session) ==
        Pointers{"/scales"});
}

TEST_CASE("what was read is written back and read again to the bit") {
  for (
      const char* text :
      {R"({"mode":"add","shape":{"type":"sphere","center":[0.1,0.2,0.30000000000000004],"radius":1e-09}})",
       R"({"mode":"set","shape":{"type":"stroke","vertices":[[0.0,1.0,2.0]],"radius":0.5},"facing":[0.0,0.0,1.0],"steal":true})",
       R"({"mode":"remove","shape":{"type":"box","min":[-1.0,-1.0,-1.0],"max":[1.0,1.0,1.0]}})",
       R"({"mode":"intersect","shape":{"type":"half_space","point":[0.0,0.0,0.0],"normal":[0.0,1.0,0.0]}})",
       R"({"mode":"add","shape":{"type":"all"}})",
       R"({"mode":"add","shape":{"type":"points","points":[[0.1,0.0,2.0]],"radius":0.5}})",
       R"({"mode":"add","shape":{"type":"points","points":[[0.1,0.0,2.0],[1.0,0.0,0.0]],"radii":[0.5,0.25]}})",
       R"({"mode":"add","shape":{"type":"screen","view":[1.0,0.0,0.0,0.0,0.0,1.0,0.0,0.0,0.0,0.0,1.0,0.0,0.0,0.0,-1.0,5.0],"outline":{"type":"polygon","vertices":[[0.0,0.1],[1.0,0.0],[0.5,1.0]]}}})",
       R"({"mode":"add","shape":{"type":"screen","view":[1.0,0.0,0.0,0.0,0.0,1.0,0.0,0.0,0.0,0.0,1.0,0.0,0.0,0.0,-1.0,5.0],"outline":{"type":"ellipse","center":[0.0,0.1],"half_axes":[1.0,0.3]},"visible":true}})",
       R"({"mode":"add","shape":{"type":"screen","view":[1.0,0.0,0.0,0.0,0.0,1.0,0.0,0.0,0.0,0.0,1.0,0.0,0.0,0.0,-1.0,5.0],"outline":{"type":"polyline","vertices":[[0.0,0.1]],"width":0.3}},"steal":true})",
       R"({"mode":"flood","seed":[0.1,0.0,2.0],"angle_deg":33.3,"radius":0.5,"stop_at_other":true,"steal":true})",
       R"({"mode":"flood","seed":[0.1,0.0,2.0]})", R"({"mode":"invert","steal":true})", R"({"mode":"clear"})",
       R"({"mode":"grow","distance":0.1})", R"({"mode":"shrink","distance":1e-09})"}) {
    CHECK(to_json(accepted(text, parse_paint_operation)).dump() == text);
  }
  const char* edit =
      R"({"level":1,"blend":"quartic","deformation":{"type":"translation","vector":[0.1,-0.2,1e-17]}})";
  CHECK(to_json(accepted(edit, parse_edit)).dump() == edit);
}

TEST_CASE("degrees survive radians: a person's angle comes back as typed, any angle to the same bits") {
  for (const double degrees : {0.0, 30.0, 37.5, 90.0, -45.0, 179.999, 0.1, 720.0, 1e-6, 35999.0}) {
    CHECK(to_degrees(to_radians(degrees)) == degrees);
  }
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> angle(-36000.0, 36000.0);
  for (int i = 0; i < 100'000; ++i) {
    const double radians = to_radians(angle(random));
    REQUIRE(to_radians(to_degrees(radians)) == radians);
  }
}

TEST_CASE("names and ids are checked") {
  CHECK(is_valid_name("Dragon, 2nd scan"));
  CHECK(is_valid_name("Zürich 龍"));
  CHECK(is_valid_name(std::string(120, 'a')));
  CHECK_FALSE(is_valid_name(""));
  CHECK_FALSE(is_valid_name(std::string(121, 'a')));
  for (const char* name : {"a\nb", "a\x7f", "\x1b[31m", "\xff", "\xc3", "\xc2\x85", "a\xe2\x28\xa1"}) {
    CHECK_FALSE(is_valid_name(name));
  }
  CHECK_FALSE(is_valid_name(std::string_view("a\0b", 3)));
  CHECK(is_valid_id(kId));
  CHECK_FALSE(is_valid_id(""));
  CHECK_FALSE(is_valid_id("Jq3cT9rVwXyZ0a1b2c3d4"));
  CHECK_FALSE(is_valid_id("Jq3cT9rVwXyZ0a1b2c3d4e5"));
  CHECK_FALSE(is_valid_id("Jq3cT9rVwXyZ0a1b2c3d4/"));
  CHECK(region_of_name("zero") == RegionKind::kZero);
  CHECK(region_of_name("one") == RegionKind::kOne);
  CHECK_FALSE(region_of_name("two").has_value());
}

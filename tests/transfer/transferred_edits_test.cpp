#include <algorithm>
#include <numbers>

#include "tests/support/all_machines.h"
#include "tests/transfer/transfer_support.h"

namespace pointwright::test {
namespace {

const HierarchyParams kTwoBands{.scales = {0.06F, 0.03F}};

Cloud bumpy(std::size_t count) {
  return to_cloud(bumpy_sphere(count, Bumps{.count = 500, .height = 0.01, .width = 0.03}));
}

std::vector<EditParams> bends() {
  return {edit_by(Rotation{.axis = Vec3d::UnitZ(), .angle_rad = 1.0}),
          edit_by(Translation{Vec3d(0.2, 0.0, 0.1)}, 2),
          edit_by(Scaling{.factors = Vec3d(1.2, 0.9, 1.0)}, 1)};
}

}  // namespace

TEST_CASE("the preview's own samples come out to the bit, levels that are derived in between included") {
  const Cloud cloud = bumpy(8000);
  for (const auto& edits :
       {bends(), {edit_by(Twist{.axis = Vec3d::UnitX(), .angle_rad = 2.0, .length = 2.0})}}) {
    const PlayedPreview preview = played(cloud, kTwoBands, edits, beside(0.3F));
    const Transferred made = transferred(preview.script, cloud);
    CHECK(same_bytes(made.rest, preview.rest));
    CHECK(same_bytes(made.surface, preview.surface));
    CHECK(!same_bytes(made.surface.finest().position, made.rest.finest().position));
  }
}

TEST_CASE("the preview's own samples are split as in the preview, to the bit, and edited further") {
  const Cloud cloud = bumpy(6000);
  EditParams stretch = edit_by(Translation{Vec3d(2.0, 0.0, 0.0)});
  stretch.resampling = ResamplingParams{};
  const PlayedPreview preview =
      played(cloud, kTwoBands, {stretch, edit_by(Translation{Vec3d(0.0, 0.3, 0.0)}, 2)}, beside(0.4F));
  const Transferred made = transferred(preview.script, cloud);
  CHECK(made.sampling->size() > cloud.size() + 500);
  CHECK(same_bytes(made.surface, preview.surface));
  CHECK(made.sampling->cloud->id == preview.sampling->cloud->id);
  CHECK(made.sampling->parent == preview.sampling->parent);
}

TEST_CASE("inserted samples stay with their parents' anchors where levels are derived afterwards") {
  const Cloud cloud = bumpy(6000);
  EditParams stretch = edit_by(Translation{Vec3d(1.5, 0.0, 0.0)}, 2);
  stretch.resampling = ResamplingParams{};
  PlayedPreview preview = played(cloud, kTwoBands, {stretch}, beside(0.4F));
  // Derived from the preview without its inserted samples: other bases, the same samples.
  auto current = cloud;
  for (std::size_t i = 0; i < cloud.size(); ++i)
    current.position.set(i, preview.surface.finest().position[i]);
  auto derived = build_hierarchy(current, kTwoBands, {});
  REQUIRE(derived.ok());
  TransferredEdit next = preview.script.edits.front();
  next.params = edit_by(Translation{Vec3d(0.0, 0.0, 0.0)});
  next.derived = std::make_shared<const LevelBases>(bases_of(derived.value()));
  preview.script.edits.push_back(next);
  const Transferred made = transferred(preview.script, cloud);
  REQUIRE(made.sampling->size() > cloud.size() + 500);
  // Every level stands within a few scales of the surface, inserted samples too.
  const float scale = derived.value().reports[0].scale;
  for (std::size_t i = 0; i < made.sampling->size(); ++i)
    CHECK((made.surface.levels[0].position[i] - made.surface.finest().position[i]).norm() < 6.0F * scale);
}

TEST_CASE("without edits, and with edits of no amount, the scan keeps its bits") {
  const Cloud cloud = bumpy(30'000);
  const Cloud coarse = preview_of(cloud, 3000);
  const PlayedPreview none = played(coarse, kTwoBands, {}, beside(0.3F));
  CHECK(same_bytes(transferred(none.script, cloud).surface.finest().position, cloud.position));
  const PlayedPreview zero = played(
      coarse, kTwoBands,
      {edit_by(Rotation{.axis = Vec3d::UnitY(), .angle_rad = 0.0}), edit_by(Translation{Vec3d::Zero()}, 1)},
      beside(0.3F));
  const Transferred made = transferred(zero.script, cloud);
  CHECK(same_bytes(made.surface.finest().position, cloud.position));
  CHECK(same_bytes(made.surface.finest().normal, cloud.normal));
}

TEST_CASE(
    "of a scan's samples those in the zero-region keep their bits, those in the one-region move rigidly") {
  const Cloud cloud = bumpy(30'000);
  const double angle = std::numbers::pi / 2.0;
  const PlayedPreview preview =
      played(preview_of(cloud, 3000), kTwoBands,
             {edit_by(Rotation{.axis = Vec3d::UnitZ(), .angle_rad = angle})}, beside(0.3F));
  const Transferred made = transferred(preview.script, cloud);
  const Eigen::AngleAxisd turn(angle, Vec3d::UnitZ());
  std::size_t still = 0;
  std::size_t rigid = 0;
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const Vec3f before = cloud.position[i];
    const Vec3f after = made.surface.finest().position[i];
    if (before.x() < -0.4F) {
      CHECK(after == before);
      CHECK(made.surface.finest().normal[i] == cloud.normal[i]);
      ++still;
    } else if (before.x() > 0.4F) {
      CHECK((after.cast<double>() - turn * before.cast<double>()).norm() < 2e-6);
      CHECK((made.surface.finest().normal[i].cast<double>() - turn * cloud.normal[i].cast<double>()).norm() <
            1e-5);
      ++rigid;
    }
  }
  CHECK(still > 5000);
  CHECK(rigid > 5000);
}

TEST_CASE("each sheet of a thin part is decomposed against its own") {
  const Cloud cloud = to_cloud(parallel_sheets(120, 0.01, 0.004, Sampling::kJittered));
  const Cloud coarse = preview_of(cloud, 2000);  // two previews' spacings are three times the gap
  const PlayedPreview preview = played(coarse, {.scales = {0.02F}}, {}, beside(0.3F));
  const AnchorIndex index(preview.script.rest);
  const auto anchors = index.anchors_of(cloud.position, cloud.normal, {});
  for (std::size_t i = 0; i < cloud.size(); ++i)
    REQUIRE(cloud.normal[i].dot(preview.script.rest.normal[anchors[i]]) > 0.0F);
  const Transferred made = transferred(preview.script, cloud);
  for (std::size_t i = 0; i < cloud.size(); ++i)
    REQUIRE(made.rest.levels[0].normal[i].dot(cloud.normal[i]) > 0.9F);
}

TEST_CASE("a scan without normals takes the preview's sides") {
  Cloud cloud = bumpy(20'000);
  const Cloud coarse = preview_of(cloud, 2000);
  const PlayedPreview preview = played(coarse, kTwoBands, {}, beside(0.3F));
  const Points truth = cloud.normal;
  cloud.normal = Points();
  const Transferred made = transferred(preview.script, cloud);
  CHECK(count_opposed(made.surface.finest().normal, truth) == 0);
}

TEST_CASE("transferred edits are the same bytes with any number of threads and on every instruction set") {
  const Cloud cloud = bumpy(12'000);
  EditParams stretch = edit_by(Translation{Vec3d(1.0, 0.0, 0.0)});
  stretch.resampling = ResamplingParams{};
  const PlayedPreview preview = played(preview_of(cloud, 2000), kTwoBands, {stretch}, beside(0.3F));
  for_all_machines([&] { return transferred(preview.script, cloud).surface; },
                   [](const MultiresSurface& a, const MultiresSurface& b) { CHECK(same_bytes(a, b)); });
}

TEST_CASE("what cannot be transferred is refused or ends as it was asked to") {
  const Cloud cloud = bumpy(2000);
  PlayedPreview preview = played(cloud, kTwoBands, bends(), beside(0.3F));
  const AnchorIndex index(preview.script.rest);
  const auto empty = transfer_edits(preview.script, index, std::make_shared<const Cloud>(), {});
  REQUIRE(!empty.ok());
  CHECK(empty.error().code == ErrorCode::kEmptyCloud);
  const ExecutionContext cancelled;
  cancelled.cancel();
  const auto ended = transfer_edits(preview.script, index, std::make_shared<const Cloud>(cloud), cancelled);
  REQUIRE(!ended.ok());
  CHECK(ended.error().code == ErrorCode::kCancelled);
  preview.script.edits[1].params.level = 3;
  const auto beyond = transfer_edits(preview.script, index, std::make_shared<const Cloud>(cloud), {});
  REQUIRE(!beyond.ok());
  CHECK(beyond.error().field == "level");
  CHECK(beyond.error().message.find("edit 2") != std::string::npos);
}

TEST_CASE("degenerate scans are legal: one sample, samples in one place, fewer than neighbours") {
  const PlayedPreview preview = played(bumpy(2000), kTwoBands, bends(), beside(0.3F));
  for (const Points& points : {from_list({Vec3f(0.1F, 0.9F, 0.2F)}), identical(40, Vec3f(0.5F, 0.8F, 0.1F)),
                               from_list({Vec3f(1.0F, 0.0F, 0.0F), Vec3f(1.0F, 0.1F, 0.0F)}),
                               from_list({Vec3f(40.0F, 0.0F, 0.0F)})}) {
    const Transferred made = transferred(preview.script, to_cloud(points));
    CHECK(all_finite(made.surface.finest().position));
    CHECK(all_finite(made.surface.finest().normal));
  }
}

}  // namespace pointwright::test

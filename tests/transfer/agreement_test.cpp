// The same edit through a preview and on the full scan's own hierarchy, in terms of what multiresolution
// editing makes of it against single resolution: at most a quarter of that on clean scans.
#include <string>

#include "tests/support/scans.h"
#include "tests/transfer/transfer_support.h"

namespace pointwright::test {
namespace {

struct Agreement {
  double preview = 0.0;  ///< RMS of (through the preview) - (direct)
  double effect = 0.0;   ///< RMS of (single resolution) - (direct)
};

/// The regions are the preview's in all three: volumes, whatever the sampling.
Agreement agreement(const Cloud& cloud, std::uint64_t preview_samples, const HierarchyParams& params,
                    const EditParams& edit, const Paint& paint) {
  Cloud oriented = cloud;
  if (!cloud.has_normals()) oriented.normal = played(cloud, params, {}, paint).rest.finest().normal;
  const PlayedPreview preview = played(preview_of(oriented, preview_samples), params, {edit}, paint);
  const RegionPair& regions = *preview.script.edits.front().regions;
  const PlayedPreview direct = played(oriented, params, {edit}, paint, &regions);
  EditParams single_edit = edit;
  single_edit.level = static_cast<std::uint32_t>(params.scales.size());
  const PlayedPreview single = played(oriented, params, {single_edit}, paint, &regions);
  const Transferred made = transferred(preview.script, oriented);
  return {.preview = rms_distance(made.surface.finest().position, direct.surface.finest().position),
          .effect = rms_distance(single.surface.finest().position, direct.surface.finest().position)};
}

}  // namespace

TEST_CASE(
    "a bumpy sphere's edit through a preview is that of the full scan, but for a part of what levels make of "
    "it") {
  const Cloud cloud = to_cloud(bumpy_sphere(100'000, Bumps{.count = 500, .height = 0.01, .width = 0.03}));
  for (const EditParams& edit : {edit_by(Rotation{.axis = Vec3d::UnitZ(), .angle_rad = 1.047}),
                                 edit_by(Translation{Vec3d(0.0, 0.8, 0.0)})}) {
    const Agreement found = agreement(cloud, 10'000, {.scales = {0.03F}}, edit, beside(0.3F));
    MESSAGE("through the preview " << found.preview << ", effect of levels " << found.effect << ", ratio "
                                   << found.preview / found.effect);
    CHECK(found.effect > 1e-4);
    CHECK(found.preview < 0.25 * found.effect);
  }
}

TEST_CASE("the scans agree as well") {
  const struct {
    const char* file;
    std::uint64_t preview_count;
    double most;
  } scans[] = {{"igea.ply", 50'000, 0.25},
               {"dragon_vrip.ply", 50'000, 0.4},
               {"dragon_vrip.ply", 100'000, 0.4},
               {"church.ply", 50'000, 0.4},
               {"church.ply", 100'000, 0.4}};
  for (const auto& [file, preview_count, most] : scans) {
    const auto cloud = real_scan(file);
    if (!cloud) continue;
    const float half = 0.5F * bounds_of(cloud->position).diagonal();
    const Vec3f middle = 0.5F * (bounds_of(cloud->position).min + bounds_of(cloud->position).max);
    const Paint paint = [&](const Vec3f& p) { return beside(0.1F * half, Vec3f::UnitY())(p - middle); };
    for (const float scale : {0.01F, 0.02F}) {
      const EditParams stretch = edit_by(Translation{Vec3d(0.25 * static_cast<double>(half), 0.0, 0.0)});
      const Agreement found = agreement(*cloud, preview_count, {.scales = {scale}}, stretch, paint);
      MESSAGE(std::string(file) << " at " << scale << " through " << preview_count << ": ratio "
                                << found.preview / found.effect);
      CHECK(found.preview < most * found.effect);
    }
  }
}

}  // namespace pointwright::test

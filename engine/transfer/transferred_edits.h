#pragma once
// Edits that were made on a preview, made on the full scan: each sample is decomposed against the preview's
// own level surfaces (§6, Figure 11). Two different bases are the only real source of disagreement, so the
// base is never computed anew at another density.

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "engine/core/cloud.h"
#include "engine/core/execution_context.h"
#include "engine/core/result.h"
#include "engine/editing/edit.h"
#include "engine/editing/region.h"
#include "engine/multires/base_surface.h"
#include "engine/multires/sampling.h"
#include "engine/multires/surface.h"
#include "engine/transfer/anchors.h"

namespace pointwright {

/// What decomposing a preview's level left behind, for other samples of the same surface.
struct LevelBases {
  std::vector<BaseSurface> bands;  ///< of levels 0, 1 ..: Hierarchy::bases
  float spacing = 0.0F;            ///< median spacing of the samples that were decomposed, model units
};

/// One edit of the preview's history.
struct TransferredEdit {
  EditParams params;
  /// The regions that it was made with, as volumes around the edited level's samples.
  std::shared_ptr<const RegionPair> regions;
  /// Where levels were derived anew before this edit, because earlier ones had left them behind: the base
  /// surfaces of the preview's coarser levels, made of its level derived->bands.size(). Else null.
  std::shared_ptr<const LevelBases> derived;
};

/// All that a preview's history says about samples which it does not hold. Immutable while it is used.
struct EditScript {
  Vec3d origin = Vec3d::Zero();  ///< what the positions of preview, regions and samples are relative to
  Level rest;                    ///< the preview's full surface before the first edit
  LevelBases bases;              ///< of its levels at rest
  std::vector<TransferredEdit> edits;
  std::uint32_t neighbors = 10;  ///< k of the full scan's graph
  /// The full scan's typical spacing by the preview's: iterations converge that much closer. One number for
  /// all parts of a scan.
  float spacing_ratio = 1.0F;
};

/// Samples after the edits, with all their levels.
struct TransferredSamples {
  MultiresSurface surface;            ///< after the last edit
  std::vector<std::uint32_t> anchor;  ///< of each sample of it: the preview's sample that stands for it
  std::shared_ptr<const Sampling> sampling;
};

/// Makes the script's edits on other samples of the same surface, or of a part of it.
/// Paper:       §6; base points by §3.4, edits by §4, resampling by §5
/// Shapes:      N >= 1 samples in coherent order, positions relative to script.origin. Without normals they
///              are estimated, on the sides of the preview
/// Promises:    a script without edits returns the input's bits; a sample that is in the zero-region of every
///              edit keeps them. The preview's own samples come out with the preview's bits
/// Locality:    positions of one edit without resampling depend on the sample alone where one band is
///              rebuilt, and on its neighbours for each further one; normals on one ring more
/// Errors:      kEmptyCloud, kInvalidArgument (what is not valid in an edit, or does not fit the bands),
///              kCancelled; with resampling those of apply_resampled_edit
/// Cost:        O(N k); about 90 + 28 n bytes a sample for n bands
/// Determinism: bitwise equal for any thread count and instruction set
/// Cancels:     between phases and blocks of samples
/// `rest`, where given, becomes the surface before the first edit.
Result<TransferredSamples> transfer_edits(const EditScript& script, const AnchorIndex& anchors,
                                          std::shared_ptr<const Cloud> cloud, const ExecutionContext& context,
                                          MultiresSurface* rest = nullptr);

/// The two halves of it: samples before the first edit, from which any edits on the same bases can go on; and
/// the edits on them, which may be other ones than script.edits.
Result<TransferredSamples> decompose_samples(const EditScript& script, const AnchorIndex& anchors,
                                             std::shared_ptr<const Cloud> cloud,
                                             const ExecutionContext& context);
Result<TransferredSamples> make_edits(const EditScript& script, std::span<const TransferredEdit> edits,
                                      TransferredSamples samples, const ExecutionContext& context);

}  // namespace pointwright

#pragma once
// A recipe on a scan at full resolution: through a preview, tile by tile where the scan is large (§6,
// Figure 11).

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "engine/core/cloud.h"
#include "engine/core/execution_context.h"
#include "protocol/json/recipe.h"
#include "server/base/outcome.h"

namespace pointwright::server {

class Team;

enum class JobMode {
  kTiles,   ///< PLY, LAS and Draco tiles: in tiles, in bounded memory, whatever the size
  kMemory,  ///< every format: the whole scan at once
  kDirect,  ///< the same, on levels of the scan's own at full resolution, with the preview's regions
};

struct JobParams {
  std::string input;
  std::string output;  ///< its name says the format; in tiles, LAS of LAS, else PLY or Draco tiles
  /// Scratch files, and what a job that was interrupted goes on from; made where it is not there.
  std::string folder;
  protocol::RecipeRequest request;
  /// What the recipe is played on; null: made of the scan, `preview_count` evenly spaced samples of it.
  std::shared_ptr<const Cloud> preview;
  std::uint64_t preview_count = 100'000;
  std::uint32_t neighbors = 10;
  std::uint64_t memory_bytes = std::uint64_t{1} << 30U;
  /// None: in tiles where the format and the recipe allow it.
  std::optional<JobMode> mode;
  /// Scans that are not read as records are decoded in a confined process of at most `most_bytes`
  /// (server/ingest/confined.h). The program must know kDecodeChildArgument.
  bool confined = false;
  std::uint64_t most_bytes = 0;  ///< of memory, for the decoder; 0: as much as it wants
  bool drop_non_finite = false;  ///< in the modes memory and direct
  Team* team = nullptr;          ///< who does it together; null: this process alone
  /// An animation: so many clouds, 2 to protocol::kMostSteps, of the recipe at s = 0 up to request.s in even
  /// steps.
  std::optional<std::uint32_t> steps = std::nullopt;
};

/// What the job writes: its output, or of an animation to edited.ply edited_0001.ply and so on.
std::vector<std::string> outputs_of(const JobParams& params);

/// What was done; of an animation the numbers are those of its last cloud. Lengths are in model units.
struct JobReport {
  JobMode mode = JobMode::kTiles;
  std::uint64_t samples = 0;
  std::uint64_t moved = 0;     ///< samples that came out otherwise than they went in
  std::uint64_t inserted = 0;  ///< by resampling, and still there in the end
  std::uint64_t removed = 0;   ///< of the scan's samples, by collection
  std::uint64_t tiles = 0;
  std::uint64_t tiles_kept = 0;  ///< of those, done before by a job that was interrupted
  std::uint64_t preview_samples = 0;
  /// Between what the preview showed and what was made of the same samples: of `matched` of them.
  std::uint64_t matched = 0;
  double rms_difference = 0.0;
  double max_difference = 0.0;
  double spacing = 0.0;            ///< the scan's typical one, to compare them with
  std::vector<std::string> files;  ///< that were written, in the order of s
};

/// What a job will take. Of the modes memory and direct it is an estimate.
struct JobEstimate {
  JobMode mode = JobMode::kTiles;
  std::uint64_t samples = 0;
  std::uint64_t memory_bytes = 0;
  std::uint64_t disk_bytes = 0;       ///< of scratch files and the result together, at most
  std::uint64_t free_disk_bytes = 0;  ///< where they go now
  double seconds = 0.0;
};
/// Looks at the scan, plays the recipe where there is a preview, and times the edits on it. Writes nothing.
/// Problems: those of run_full_resolution() that show so early
Outcome<JobEstimate> estimate_full_resolution(const JobParams& params, const ExecutionContext& context);

/// Where a job stands; called between phases and tiles.
using JobProgress = std::function<void(const std::string& phase, double fraction)>;

/// Runs the job to its end. The output appears whole or not at all, each of an animation's clouds likewise.
/// An animation decomposes the scan once; its last cloud is the plain job's. In tiles a job that was
/// interrupted goes on where it was, where its folder, its input and its recipe are the same; the folder is
/// removed in the end.
/// A team's processes share the input, the output and the folder; each takes its part of every pass and of
/// the tiles, and all get the same report. In the other modes the leader does it alone.
/// Problems:    those of reading the input, of play_on_preview and of writing; kCancelled
/// Promises:    samples that no edit moved keep their bytes; a recipe without effect gives the input's bytes
/// Cost:        two passes over the input, 32 bytes of disk a sample and, for each cloud that is written, as
///              many for each that moves; one pass and the records' bytes more where the input is unpacked
///              first (ASCII PLY, Draco tiles), three and twice these where the result is packed
/// Determinism: the same bytes for any number of threads; memory_bytes, which says how large tiles are, may
///              change what a tile's neighbours at its border are taken to be
Outcome<JobReport> run_full_resolution(const JobParams& params, const ExecutionContext& context,
                                       const JobProgress& progress);

}  // namespace pointwright::server

#include "server/jobs/scan_source.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <limits>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "engine/io/decoded_cloud.h"
#include "protocol/json/jobs.h"
#include "server/base/descriptor.h"
#include "server/cli/local_file.h"
#include "server/ingest/confined.h"
#include "server/ingest/files.h"

namespace pointwright::server {

using protocol::Problem;
using protocol::ProblemKind;

ConfineLimits confinement(const JobParams& params, std::uint64_t bytes) {
  constexpr double kBytesPerSecond = 4.0 * 1024 * 1024;  // of decoding, at least
  ConfineLimits confine;
  if (params.most_bytes > 0) confine.memory_bytes = params.most_bytes;
  confine.deadline_seconds += static_cast<double>(bytes) / kBytesPerSecond;
  return confine;
}

Result<ImportedCloud> read_scan(const JobParams& params) {
  const ImportParams import{.max_samples = std::numeric_limits<std::uint32_t>::max() - 1U,
                            .drop_non_finite = params.drop_non_finite};
  if (!params.confined)
    return read_local_cloud(params.input, import, std::numeric_limits<std::uint64_t>::max());
  constexpr std::uint64_t kStartBytes = std::uint64_t{1} << 20U;  // enough to know the format by
  const Descriptor file(::open(params.input.c_str(), O_RDONLY | O_CLOEXEC));
  std::error_code none;
  const std::uint64_t size = std::filesystem::file_size(params.input, none);
  std::vector<std::byte> start;
  const bool is_read =
      !none && file.is_open() &&
      read_pieces(file.get(), std::min(size, kStartBytes), [&](std::span<const std::byte> piece) {
        start.insert(start.end(), piece.begin(), piece.end());
        return true;
      });
  if (!is_read)
    return Error{
        .code = ErrorCode::kInvalidArgument, .message = "cannot read " + params.input, .field = "path"};
  const auto format = detect_format(start);
  if (!format) return format.error();
  auto decoded =
      decode_confined(file.get(), size, format.value(), import, confinement(params, size), nullptr);
  if (!decoded) return decoded.error();
  return finish_cloud(std::move(decoded).value(), import);
}

namespace {

bool resamples(const protocol::RecipeRequest& request) {
  return std::ranges::any_of(request.recipe.edits, [](const protocol::RecipeEdit& edit) {
    return edit.edit.resampling.has_value();
  });
}

Problem invalid(const char* detail) {
  return {.kind = ProblemKind::kInvalidValue, .detail = detail};
}

/// What no mode can do.
std::optional<Problem> check(const JobParams& params) {
  if (params.steps && (*params.steps < 2 || *params.steps > protocol::kMostSteps))
    return Problem{
        .kind = ProblemKind::kInvalidValue,
        .detail = std::string("steps must lie between 2 and ").append(std::to_string(protocol::kMostSteps)),
        .limit = static_cast<double>(protocol::kMostSteps),
        .actual = static_cast<double>(*params.steps)};
  if (params.steps && params.mode == JobMode::kDirect)
    return invalid("steps are made in tiles or in memory, not in the mode direct");
  std::error_code ignored;
  for (const std::string& output : outputs_of(params)) {
    if (std::filesystem::equivalent(params.input, output, ignored))
      return invalid("a job does not write over its own input");
    if (std::filesystem::is_directory(output, ignored)) return invalid("the output is a folder");
  }
  const std::string folder = std::filesystem::path(params.output).parent_path().string();
  if (::access(folder.empty() ? "." : folder.c_str(), W_OK) != 0)
    return Problem{.kind = ProblemKind::kInvalidValue,
                   .detail = std::string("the output cannot be written: ")
                                 .append(folder.empty() ? "." : folder)
                                 .append(": ")
                                 .append(std::system_category().message(errno))};
  return std::nullopt;
}

}  // namespace

Outcome<ChosenMode> choose_mode(const JobParams& params) {
  if (auto problem = check(params)) return *problem;
  if (params.mode && *params.mode != JobMode::kTiles) return ChosenMode{.mode = *params.mode};
  auto file = MappedFile::open(params.input);
  if (!file) return protocol::to_problem(file.error());
  auto records = ScanRecords::of(file.value().bytes());
  if (!records) return protocol::to_problem(records.error());
  auto packed = records.value() ? Result<std::optional<PackedScan>>(std::nullopt) : packed_scan(file.value());
  if (!packed) return protocol::to_problem(packed.error());
  const auto wanted = format_of_name(params.output);
  if (!wanted) return protocol::to_problem(wanted.error());
  const bool packs = wanted.value() == CloudFormat::kDracoTiles;
  const bool is_ply = packed.value() || (records.value() && records.value()->format == CloudFormat::kPly);
  const bool fits = is_ply ? packs || wanted.value() == CloudFormat::kPly
                           : records.value() && records.value()->format == wanted.value();
  // Tiles take every sample that there is.
  const bool drops = is_ply && params.drop_non_finite && !params.mode;
  const std::uint64_t least = packed.value() ? packed.value()->least_memory() : 0;
  const bool has_room = least <= params.memory_bytes;
  const bool can_grow = !records.value() || records.value()->can_grow();
  if (fits && !drops && has_room && (can_grow || !resamples(params.request)))
    return ChosenMode{.mode = JobMode::kTiles,
                      .file = std::move(file).value(),
                      .records = std::move(records).value(),
                      .packed = packed.value(),
                      .packs = packs};
  if (!params.mode) return ChosenMode{.mode = JobMode::kMemory};
  if (fits && !has_room)
    return Problem{.kind = ProblemKind::kOutOfSpace,
                   .detail = "a tile of " + std::to_string(packed.value()->most_of_tile) +
                             " samples takes more memory than the job may have: cut it into smaller ones",
                   .limit = static_cast<double>(params.memory_bytes),
                   .actual = static_cast<double>(least)};
  if (fits)
    return invalid(
        "the file holds faces or other elements, which count its samples: with resampling use the mode "
        "memory or direct, which leave them out");
  return Problem{
      .kind = ProblemKind::kUnsupportedFormat,
      .detail =
          "in tiles are read PLY, whose vertices have no lists where it is binary, and Draco tiles, written "
          "as either, and LAS, written as LAS: use the mode memory"};
}

}  // namespace pointwright::server

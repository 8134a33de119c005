#include "server/jobs/result_writer.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <memory>
#include <mutex>
#include <utility>

#include "engine/core/parallel.h"
#include "server/ingest/files.h"

namespace pointwright::server {

using protocol::Problem;

namespace {

constexpr std::uint64_t kWriteChunk = std::uint64_t{1} << 20U;  // samples
constexpr std::size_t kChunksAtOnce = 2;

bool any_moved(const std::vector<MovedSamples>& moved) {
  return std::ranges::any_of(moved, [](const MovedSamples& tile) { return !tile.samples.empty(); });
}

}  // namespace

std::optional<Problem> ResultWriter::write(const std::string& output,
                                           const std::vector<MovedSamples>& moved) {
  const auto as_problem = [](const Result<void>& result) {
    return result ? std::nullopt : std::optional(protocol::to_problem(result.error()));
  };
  if (!team_.leads()) {
    const std::string path = team_.told({});
    if (path.empty()) return team_.agree(std::nullopt);
    static_cast<void>(team_.agree(as_problem(write_share(path, moved))));
    return team_.agree(std::nullopt);  // whether the file has got its name
  }
  bool is_made = false;
  std::optional<Problem> theirs;
  const auto written = fill_file_atomically(output, [&](int out) -> Result<bool> {
    is_made = true;
    const std::string path = std::filesystem::read_symlink("/proc/self/fd/" + std::to_string(out)).string();
    static_cast<void>(team_.told(path));
    const auto share = write_share(path, moved);
    theirs = team_.agree(as_problem(share));
    if (!share) return share.error();
    if (theirs) return cancelled_error();
    return true;
  });
  if (!is_made) static_cast<void>(team_.told({}));
  auto problem = as_problem(written);
  if (theirs) problem = theirs;
  return team_.agree(problem);
}

Result<void> ResultWriter::write_share(const std::string& path, const std::vector<MovedSamples>& moved) {
  const auto file = team_.open(path);
  if (file == nullptr) return file_error("cannot write", path, errno);
  const auto done = write_records(*file, moved);
  if (!done) return done.error();
  if (!done.value() || !file->sync()) return file_error("cannot write", path, errno);
  return {};
}

Result<bool> ResultWriter::write_records(SharedFile& out, const std::vector<MovedSamples>& moved) {
  const std::span<const std::byte> bytes = file_.bytes();
  // Every chunk has its place in the file, so they may be made and written side by side.
  const std::uint64_t chunks = (records_.count + kWriteChunk - 1) / kWriteChunk;
  std::atomic<std::uint64_t> next{0};
  std::atomic<bool> unsaid{false};
  // Nobody leaves before all have met below.
  std::atomic<int> failure{0};  // errno
  if (team_.leads() && !out.write_at(bytes.first(static_cast<std::size_t>(records_.begin)), 0))
    failure = errno;
  std::mutex mutex;  // guards the progress
  std::uint64_t done = 0;
  // A LAS file's header says how far its samples reach.
  const bool has_bounds = records_.format == CloudFormat::kLas && any_moved(moved);
  ModelBox reach;
  const auto write_chunks = [&] {
    std::vector<std::byte> chunk;
    for (std::uint64_t k = next++; k < chunks; k = next++) {
      if (!team_.takes(k)) continue;
      if (context_.is_cancelled() || failure != 0 || unsaid) return;
      const std::uint64_t begin = k * kWriteChunk;
      const std::uint64_t end = std::min(records_.count, begin + kWriteChunk);
      const std::uint64_t from = records_.begin + begin * records_.record_bytes;
      const std::uint64_t to = records_.begin + end * records_.record_bytes;
      chunk.assign(bytes.begin() + static_cast<std::ptrdiff_t>(from),
                   bytes.begin() + static_cast<std::ptrdiff_t>(to));
      // Tiles share no sample, so they can be put in side by side.
      parallel_for(
          moved.size(),
          [&](std::size_t first, std::size_t last) {
            for (std::size_t tile = first; tile < last; ++tile)
              if (!replace(moved[tile], begin, end, chunk.data())) unsaid = true;
          },
          1);
      if (unsaid) return;
      if (!out.write_at(chunk, from)) failure = errno;
      file_.release(from, to);
      const ModelBox here = has_bounds ? reach_of(chunk) : ModelBox();
      const std::lock_guard lock(mutex);
      reach.join(here);
      done += static_cast<std::uint64_t>(team_.size());
      progress_(std::min(1.0, static_cast<double>(done) / static_cast<double>(chunks + 1)));
    }
  };
  parallel_for(
      kChunksAtOnce, [&](std::size_t, std::size_t) { write_chunks(); }, 1);
  if (has_bounds && !write_bounds(out, reach)) failure = errno;
  if (context_.is_cancelled()) return cancelled_error();
  if (unsaid)
    return Error{.code = ErrorCode::kInvalidArgument,
                 .message =
                     "the edits take samples to where the file's whole numbers cannot say them: the "
                     "mode memory chooses a grid that can, and so does PLY",
                 .field = "deformation"};
  if (failure == 0 && (!team_.leads() ||
                       out.write_at(bytes.subspan(static_cast<std::size_t>(records_.end())), records_.end())))
    return true;
  if (failure != 0) errno = failure;
  return false;
}

ResultWriter::ModelBox ResultWriter::reach_of(std::span<const std::byte> chunk) const {
  const std::size_t count = chunk.size() / records_.record_bytes;
  std::vector<ModelBox> parts((count + kParallelBlock - 1) / kParallelBlock);
  parallel_for(count, [&](std::size_t begin, std::size_t end) {
    ModelBox& part = parts[begin / kParallelBlock];
    for (std::size_t i = begin; i < end; ++i) {
      const Vec3d p = records_.position(chunk.data() + i * records_.record_bytes);
      part.join({.min = p, .max = p});
    }
  });
  ModelBox box;
  for (const ModelBox& part : parts) box.join(part);
  return box;
}

bool ResultWriter::write_bounds(SharedFile& out, const ModelBox& mine) {
  ModelBox all;
  for (const auto& bytes : team_.gather(std::as_bytes(std::span(&mine, 1)))) {
    ModelBox theirs;
    std::memcpy(static_cast<void*>(&theirs), bytes.data(), sizeof theirs);
    all.join(theirs);
  }
  // Greatest and least x, then y, then z, in every version of the format.
  constexpr std::uint64_t kBoundsAt = 179;
  const std::array<double, 6> bounds{all.max.x(), all.min.x(), all.max.y(),
                                     all.min.y(), all.max.z(), all.min.z()};
  return !team_.leads() || out.write_at(std::as_bytes(std::span(bounds)), kBoundsAt);
}

bool ResultWriter::replace(const MovedSamples& moved, std::uint64_t begin, std::uint64_t end,
                           std::byte* chunk) const {
  const auto first = std::ranges::lower_bound(moved.samples, begin, {}, &TileSample::index);
  const auto last = std::ranges::lower_bound(first, moved.samples.end(), end, {}, &TileSample::index);
  bool can = true;
  for (auto sample = first; sample != last; ++sample) {
    if (sample->index < begin || sample->index >= end) return false;  // a damaged result
    can = replace(*sample, chunk + (sample->index - begin) * records_.record_bytes) && can;
  }
  // All of it: the search above has read pages here and there, too.
  moved.file.release(0, moved.file.bytes().size());
  return can;
}

bool ResultWriter::replace(const TileSample& sample, std::byte* record) const {
  const Vec3f p(sample.position[0], sample.position[1], sample.position[2]);
  const Vec3d place = origin_ + p.cast<double>();
  if (!records_.can_say(place)) return false;
  records_.set_position(record, place);
  if (records_.has_normals())
    records_.set_normal(record, {sample.normal[0], sample.normal[1], sample.normal[2]});
  return true;
}

}  // namespace pointwright::server

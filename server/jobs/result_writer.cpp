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
#include "server/jobs/tile_fates.h"

namespace pointwright::server {

using protocol::Problem;

namespace {

constexpr std::uint64_t kWriteChunk = std::uint64_t{1} << 20U;  // samples
/// Where samples were inserted: each may have become kMostParts of them.
constexpr std::uint64_t kGrowingChunk = std::uint64_t{1} << 17U;
/// Of a chunk's records, however long each is.
constexpr std::uint64_t kChunkBytes = std::uint64_t{1} << 26U;
constexpr std::uint64_t kLeastChunk = std::uint64_t{1} << 10U;
constexpr std::uint64_t kInsertedPiece = std::uint64_t{1} << 18U;  // that are written together
constexpr std::size_t kChunksAtOnce = 2;

/// Of the ascending numbers those from begin on and before end.
std::span<const std::uint64_t> between(std::span<const std::uint64_t> numbers, std::uint64_t begin,
                                       std::uint64_t end) {
  const auto first = std::ranges::lower_bound(numbers, begin);
  return {first, std::lower_bound(first, numbers.end(), end)};
}

}  // namespace

void ResultWriter::Contents::join(const Contents& other) {
  reach.join(other.reach);
  for (std::size_t k = 0; k < returns.size(); ++k) returns.at(k) += other.returns.at(k);
}

std::optional<Problem> ResultWriter::write(const std::string& output, const std::vector<MadeTile>& tiles) {
  const auto as_problem = [](const Result<void>& result) {
    return result ? std::nullopt : std::optional(protocol::to_problem(result.error()));
  };
  tiles_ = tiles;
  cut_into_chunks();
  auto head = head_of_result(records_, file_.bytes(), records_.count - removed_ + inserted_);
  if (!head) return protocol::to_problem(head.error());  // the same for all of them
  head_ = std::move(head).value();
  if (!team_.leads()) {
    const std::string path = team_.told({});
    if (path.empty()) return team_.agree(std::nullopt);
    static_cast<void>(team_.agree(as_problem(write_share(path))));
    return team_.agree(std::nullopt);  // whether the file has got its name
  }
  bool is_made = false;
  std::optional<Problem> theirs;
  const auto written = fill_file_atomically(output, [&](int out) -> Result<bool> {
    is_made = true;
    const std::string path = std::filesystem::read_symlink("/proc/self/fd/" + std::to_string(out)).string();
    static_cast<void>(team_.told(path));
    const auto share = write_share(path);
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

void ResultWriter::cut_into_chunks() {
  removed_ = inserted_ = 0;
  bool any_moved = false;
  for (const MadeTile& tile : tiles_) {
    removed_ += tile.result.removed.size();
    inserted_ += tile.result.roots.size();
    any_moved = any_moved || !tile.result.moved.empty();
  }
  // A LAS file's header says how far its samples reach.
  has_contents_ = records_.format == CloudFormat::kLas && (any_moved || removed_ + inserted_ > 0);
  const std::uint64_t most = inserted_ > 0 ? kGrowingChunk : kWriteChunk;
  const std::uint64_t size = std::clamp(kChunkBytes / records_.record_bytes, kLeastChunk, most);
  chunks_.clear();
  for (std::uint64_t begin = 0; begin < records_.count; begin += size)
    chunks_.push_back({.begin = begin, .end = std::min(records_.count, begin + size)});
  if (removed_ + inserted_ == 0) return;
  parallel_for(
      chunks_.size(),
      [&](std::size_t first, std::size_t last) {
        for (Chunk& chunk : std::span(chunks_).subspan(first, last - first))
          for (const MadeTile& tile : tiles_) {
            chunk.removed_before += between(tile.result.removed, chunk.begin, chunk.end).size();
            chunk.inserted_before += between(tile.result.roots, chunk.begin, chunk.end).size();
          }
      },
      1);
  // So many are in each; so many are before it.
  std::uint64_t removed = 0;
  std::uint64_t inserted = 0;
  for (Chunk& chunk : chunks_) {
    chunk.loses = chunk.removed_before > 0;
    removed += std::exchange(chunk.removed_before, removed);
    inserted += std::exchange(chunk.inserted_before, inserted);
  }
}

Result<void> ResultWriter::write_share(const std::string& path) {
  const auto file = team_.open(path);
  if (file == nullptr) return file_error("cannot write", path, errno);
  const auto done = write_records(*file);
  const int failure = done && !done.value() ? errno : 0;
  // By all of them, whoever has failed.
  const bool is_kept = file->sync();
  if (!done) return done.error();
  if (failure != 0 || !is_kept) return file_error("cannot write", path, failure != 0 ? failure : errno);
  return {};
}

Result<bool> ResultWriter::write_records(SharedFile& out) {
  // Every chunk has its place in the file, so they may be made and written side by side.
  std::atomic<std::size_t> next{0};
  std::atomic<bool> unsaid{false};
  // Nobody leaves before all have met below.
  std::atomic<int> failure{0};  // errno
  std::mutex mutex;             // guards the contents and the progress
  std::uint64_t done = 0;
  Contents contents;
  const auto write_chunks = [&] {
    std::vector<std::byte> bytes;
    for (std::size_t k = next++; k < chunks_.size(); k = next++) {
      if (!team_.takes(k)) continue;
      if (context_.is_cancelled() || failure != 0 || unsaid) return;
      const Chunk& chunk = chunks_[k];
      if (!make(chunk, bytes)) {
        unsaid = true;
        return;
      }
      const std::uint64_t to = head_.size() + (chunk.begin - chunk.removed_before) * records_.record_bytes;
      if (!out.write_at(bytes, to)) failure = errno;
      Contents here = contents_of(bytes);
      if (inserted_ > 0 && !write_inserted(out, k, here)) failure = errno;
      const std::lock_guard lock(mutex);
      contents.join(here);
      done += static_cast<std::uint64_t>(team_.size());
      progress_(std::min(1.0, static_cast<double>(done) / static_cast<double>(chunks_.size() + 1)));
    }
  };
  parallel_for(
      kChunksAtOnce, [&](std::size_t, std::size_t) { write_chunks(); }, 1);
  if (!write_head(out, contents)) failure = errno;
  if (context_.is_cancelled()) return cancelled_error();
  if (unsaid) return unsaid_place();
  if (failure == 0 &&
      (!team_.leads() ||
       out.write_at(file_.bytes().subspan(static_cast<std::size_t>(records_.end())),
                    head_.size() + (records_.count - removed_ + inserted_) * records_.record_bytes)))
    return true;
  if (failure != 0) errno = failure;
  return false;
}

bool ResultWriter::make(const Chunk& chunk, std::vector<std::byte>& bytes) const {
  const std::uint64_t from = records_.begin + chunk.begin * records_.record_bytes;
  const std::uint64_t to = records_.begin + chunk.end * records_.record_bytes;
  const auto scan =
      file_.bytes().subspan(static_cast<std::size_t>(from), static_cast<std::size_t>(to - from));
  bytes.assign(scan.begin(), scan.end());
  file_.release(from, to);
  // Tiles share no sample, so they can be put in side by side.
  std::atomic<bool> unsaid{false};
  parallel_for(
      tiles_.size(),
      [&](std::size_t first, std::size_t last) {
        for (const MadeTile& tile : tiles_.subspan(first, last - first))
          if (!replace(tile, chunk.begin, chunk.end, bytes.data())) unsaid = true;
      },
      1);
  if (unsaid) return false;
  if (chunk.loses) drop_removed(chunk, bytes);
  return true;
}

void ResultWriter::drop_removed(const Chunk& chunk, std::vector<std::byte>& bytes) const {
  std::vector<std::uint64_t> gone;
  for (const MadeTile& tile : tiles_) {
    const auto here = between(tile.result.removed, chunk.begin, chunk.end);
    gone.insert(gone.end(), here.begin(), here.end());
  }
  std::ranges::sort(gone);
  gone.push_back(chunk.end);
  const std::uint64_t size = records_.record_bytes;
  // What stays between two that go moves up.
  std::byte* to = bytes.data() + (gone.front() - chunk.begin) * size;
  for (std::size_t k = 0; k + 1 < gone.size(); ++k) {
    const std::byte* const from = bytes.data() + (gone[k] + 1 - chunk.begin) * size;
    const std::uint64_t stays = (gone[k + 1] - gone[k] - 1) * size;
    std::memmove(to, from, stays);
    to += stays;
  }
  bytes.resize(bytes.size() - (gone.size() - 1) * size);
}

bool ResultWriter::write_inserted(SharedFile& out, std::size_t chunk, Contents& contents) const {
  struct Record {
    std::uint64_t root = 0;
    const std::byte* bytes = nullptr;
  };
  const std::uint64_t size = records_.record_bytes;
  std::vector<Record> records;
  for (const MadeTile& tile : tiles_) {
    const auto here = between(tile.result.roots, chunks_[chunk].begin, chunks_[chunk].end);
    const std::byte* bytes =
        tile.result.records.data() + static_cast<std::size_t>(here.data() - tile.result.roots.data()) * size;
    for (const std::uint64_t root : here) {
      records.push_back({.root = root, .bytes = bytes});
      bytes += size;
    }
  }
  // Those of one root are of one tile, in their order.
  std::ranges::stable_sort(records, {}, &Record::root);
  std::uint64_t at = head_.size() + (records_.count - removed_ + chunks_[chunk].inserted_before) * size;
  std::vector<std::byte> piece;
  const std::uint64_t most = std::clamp(kChunkBytes / size, kLeastChunk, kInsertedPiece);
  for (std::size_t first = 0; first < records.size(); first += most) {
    const std::size_t count = std::min<std::size_t>(most, records.size() - first);
    piece.resize(count * size);
    for (std::size_t k = 0; k < count; ++k)
      std::memcpy(piece.data() + k * size, records[first + k].bytes, size);
    if (!out.write_at(piece, at)) return false;
    at += piece.size();
    contents.join(contents_of(piece));
  }
  for (const MadeTile& tile : tiles_) tile.file.release(0, tile.file.bytes().size());
  return true;
}

ResultWriter::Contents ResultWriter::contents_of(std::span<const std::byte> chunk) const {
  Contents contents;
  if (!has_contents_) return contents;
  const std::size_t count = chunk.size() / records_.record_bytes;
  std::vector<ModelBox> parts((count + kParallelBlock - 1) / kParallelBlock);
  parallel_for(count, [&](std::size_t begin, std::size_t end) {
    ModelBox& part = parts[begin / kParallelBlock];
    for (std::size_t i = begin; i < end; ++i) {
      const Vec3d p = records_.position(chunk.data() + i * records_.record_bytes);
      part.join({.min = p, .max = p});
    }
  });
  for (const ModelBox& part : parts) contents.reach.join(part);
  if (removed_ + inserted_ > 0) add_returns(records_, chunk, contents.returns);
  return contents;
}

bool ResultWriter::write_head(SharedFile& out, const Contents& mine) {
  if (has_contents_) {
    Contents all;
    for (const auto& bytes : team_.gather(std::as_bytes(std::span(&mine, 1)))) {
      Contents theirs;
      std::memcpy(static_cast<void*>(&theirs), bytes.data(), sizeof theirs);
      all.join(theirs);
    }
    // Greatest and least x, then y, then z, in every version of the format.
    constexpr std::size_t kBoundsAt = 179;
    const ModelBox& reach = all.reach;
    const std::array<double, 6> bounds{reach.max.x(), reach.min.x(), reach.max.y(),
                                       reach.min.y(), reach.max.z(), reach.min.z()};
    std::ranges::copy(std::as_bytes(std::span(bounds)), head_.begin() + kBoundsAt);
    if (removed_ + inserted_ > 0) set_returns(head_, all.returns);
  }
  return !team_.leads() || out.write_at(head_, 0);
}

bool ResultWriter::replace(const MadeTile& tile, std::uint64_t begin, std::uint64_t end,
                           std::byte* chunk) const {
  const auto moved = tile.result.moved;
  const auto first = std::ranges::lower_bound(moved, begin, {}, &TileSample::index);
  const auto last = std::ranges::lower_bound(first, moved.end(), end, {}, &TileSample::index);
  bool can = true;
  for (auto sample = first; sample != last; ++sample) {
    if (sample->index < begin || sample->index >= end) return false;  // a damaged result
    can = replace(*sample, chunk + (sample->index - begin) * records_.record_bytes) && can;
  }
  // All of it: the search above has read pages here and there, too.
  tile.file.release(0, tile.file.bytes().size());
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

#include "server/jobs/tile_store.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstring>
#include <functional>
#include <limits>
#include <span>
#include <system_error>
#include <utility>

#include "engine/core/parallel.h"
#include "engine/spatial/block_tree.h"
#include "engine/spatial/coherent_order.h"
#include "server/base/descriptor.h"
#include "server/ingest/files.h"
#include "server/jobs/raw_bytes.h"

namespace pointwright::server {
namespace {

constexpr std::uint64_t kChunkSamples = std::uint64_t{1} << 21U;  // that are sorted together
/// Where their records go along.
constexpr std::uint64_t kChunkRecordBytes = std::uint64_t{1} << 26U;
constexpr std::uint64_t kLeastChunkSamples = std::uint64_t{1} << 14U;
constexpr std::size_t kChunksAtOnce = 2;
constexpr std::uint64_t kIndexMagic = 0x32584449'54575054ULL;
constexpr std::uint64_t kResultMagic = 0x32534552'54575054ULL;
/// What a tile's result begins with; its parts follow in this order, then the inserted samples' records.
struct ResultHead {
  std::uint64_t magic = kResultMagic;
  std::uint64_t moved = 0;
  std::uint64_t removed = 0;
  std::uint64_t inserted = 0;
  std::uint64_t counts = 0;
  std::uint64_t matches = 0;
  /// Of the parts without the records. Pre: each count is less than 2^58
  [[nodiscard]] std::uint64_t bytes() const {
    return moved * sizeof(TileSample) + (removed + inserted + counts) * sizeof(std::uint64_t) +
           matches * sizeof(PreviewMatch);
  }
};

constexpr std::size_t kProbes = 64;  // blocks of samples whose neighbourhoods say how wide a ring is

Descriptor opened(const std::string& path, int flags) {
  return Descriptor(::open(path.c_str(), flags | O_CLOEXEC, 0600));
}

std::string spool_path(const std::string& folder) {
  return folder + "/samples.bin";
}
std::string records_path(const std::string& folder) {
  return folder + "/records.bin";
}
std::string index_path(const std::string& folder) {
  return folder + "/samples.index";
}

/// How far neighbourhoods reach, by probes all over the samples, which are in coherent order: a quarter more
/// than all but a twentieth of them, so that strays far from everything do not widen it; at least `least`.
float ring_width(const Points& position, std::uint32_t neighbors, float least) {
  if (position.size() <= neighbors) return least;
  const BlockTree tree(position);
  const std::size_t blocks = (position.size() + kSimdBlock - 1) / kSimdBlock;
  const std::size_t step = std::max<std::size_t>(1, blocks / kProbes);
  std::vector<std::int32_t> rows;
  std::vector<float> reaches;
  for (std::size_t block = 0; block < blocks; block += step) {
    const std::size_t begin = block * kSimdBlock;
    const std::size_t end = std::min(begin + kSimdBlock, position.size());
    tree.nearest_of_range(begin, end, neighbors, std::numeric_limits<float>::infinity(), rows);
    for (std::size_t i = begin; i < end; ++i) {
      for (std::uint32_t j = neighbors; j-- > 0;) {
        const std::int32_t found = rows[j * kSimdBlock + i % kSimdBlock];
        if (found < 0) continue;
        reaches.push_back((position[i] - position[static_cast<std::size_t>(found)]).norm());
        break;
      }
    }
  }
  if (reaches.empty()) return least;
  const auto most = reaches.begin() + static_cast<std::ptrdiff_t>(reaches.size() * 19 / 20);
  std::nth_element(reaches.begin(), most, reaches.end());
  return std::max(least, 1.25F * *most);
}

template <typename Work>
void for_each(std::size_t count, const Work& work) {
  parallel_for(count, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) work(i);
  });
}

std::byte* bytes_of(TileSample* samples) {
  return reinterpret_cast<std::byte*>(samples);
}

Vec3f place_of(const TileSample& sample) {
  return {sample.position[0], sample.position[1], sample.position[2]};
}

}  // namespace

TileStore::TileStore(std::string folder, TileCuts cuts, const Vec3d& origin)
    : folder_(std::move(folder)), cuts_(std::move(cuts)), origin_(origin), extents_(cuts_.cell_count()) {}

std::uint64_t TileStore::cell_samples(std::size_t cell) const {
  std::uint64_t count = 0;
  for (const Extent& extent : extents_[cell]) count += extent.count;
  return count;
}

std::uint64_t TileStore::sample_count(std::size_t tile) const {
  std::uint64_t count = 0;
  for (std::size_t cell = cuts_.first_cell(tile); cell < cuts_.first_cell(tile + 1); ++cell)
    count += cell_samples(cell);
  return count;
}

std::vector<std::byte> TileStore::index_bytes() const {
  std::vector<std::byte> bytes;
  const std::array<std::uint64_t, 2> head{kIndexMagic, extents_.size()};
  append_raw(bytes, head.data(), head.size());
  for (const auto& extents : extents_) {
    const std::uint64_t count = extents.size();
    append_raw(bytes, &count, 1);
    append_raw(bytes, extents.data(), extents.size());
  }
  return bytes;
}

bool TileStore::read_index() {
  const auto bytes = read_file(index_path(folder_), std::uint64_t{1} << 32U);
  if (!bytes) return false;
  std::span<const std::byte> rest = bytes.value();
  std::array<std::uint64_t, 2> head{};
  if (!take_raw(rest, head.data(), head.size()) || head[0] != kIndexMagic || head[1] != cuts_.cell_count())
    return false;
  std::vector<std::vector<Extent>> extents(cuts_.cell_count());
  for (auto& list : extents) {
    std::uint64_t count = 0;
    if (!take_raw(rest, &count, 1) || count > rest.size() / sizeof(Extent)) return false;
    list.resize(static_cast<std::size_t>(count));
    if (!take_raw(rest, list.data(), list.size())) return false;
  }
  if (!rest.empty()) return false;
  extents_ = std::move(extents);
  return true;
}

bool TileStore::is_sorted(std::uint64_t samples) {
  std::error_code none;
  const std::uint64_t bytes = std::filesystem::file_size(spool_path(folder_), none);
  return !none && bytes == samples * sizeof(TileSample) && read_index();
}

bool TileStore::is_ours(const std::filesystem::path& path) {
  // What is being written has a name of its own behind that.
  const std::string name = path.filename().string();
  const std::string whole = name.substr(0, name.find(".new-"));
  return whole == "job.id" || whole == "samples.bin" || whole == "records.bin" || whole == "samples.index" ||
         (whole.starts_with("tile-") && whole.ends_with(".result"));
}

void TileStore::clear(const std::string& folder) {
  std::error_code none;
  for (const char* const name : {"job.id", "samples.index"})
    std::filesystem::remove(folder + "/" + name, none);
  std::vector<std::filesystem::path> ours;
  for (const auto& entry : std::filesystem::directory_iterator(folder, none))
    if (is_ours(entry.path())) ours.push_back(entry.path());
  for (const auto& path : ours) std::filesystem::remove(path, none);
}

Result<void> TileStore::begin() const {
  const std::string path = spool_path(folder_);
  if (!opened(path, O_WRONLY | O_CREAT | O_TRUNC).is_open()) return file_error("cannot write", path, errno);
  return {};
}

Result<void> TileStore::finish() const {
  return write_file_atomically(index_path(folder_), index_bytes());
}

Result<void> TileStore::sort(const MappedFile& file, const ScanRecords& records, Team& team,
                             const ExecutionContext& context, bool with_records) {
  const std::string path = spool_path(folder_);
  const Descriptor spool = opened(path, O_WRONLY);
  // Nobody leaves before all have met below.
  std::atomic<int> failure{spool.is_open() ? 0 : errno};
  const Descriptor whole = with_records ? opened(records_path(folder_), O_WRONLY | O_CREAT) : Descriptor();
  std::atomic<int> records_failure{with_records && !whole.is_open() ? errno : 0};
  const std::byte* const first = file.bytes().data() + records.begin;
  // Every chunk has its place in the spool, so they may be sorted and written side by side.
  const std::uint64_t chunk_samples =
      with_records ? std::clamp(kChunkRecordBytes / records.record_bytes, kLeastChunkSamples, kChunkSamples)
                   : kChunkSamples;
  const auto chunks = static_cast<std::size_t>((records.count + chunk_samples - 1) / chunk_samples);
  std::vector<std::vector<std::pair<std::uint32_t, Extent>>> extents(chunks);
  std::atomic<std::size_t> next{0};
  const auto sort_chunks = [&] {
    std::vector<std::uint32_t> cells;
    std::vector<TileSample> sorted;
    std::vector<std::byte> bytes;
    std::vector<std::size_t> place(cuts_.cell_count() + 1);
    for (std::size_t chunk = next++; chunk < chunks; chunk = next++) {
      if (!team.takes(chunk)) continue;
      if (context.is_cancelled() || failure != 0 || records_failure != 0) return;
      const std::uint64_t begin = chunk * chunk_samples;
      const auto count = static_cast<std::size_t>(std::min(chunk_samples, records.count - begin));
      const auto place_of_record = [&](const std::byte* record) {
        // At origin 0 the cast alone keeps a negative zero.
        const Vec3d p = records.position(record);
        return Vec3f(Vec3d((origin_.array() == 0.0).select(p, p - origin_)).cast<float>());
      };
      const std::byte* const from = first + begin * records.record_bytes;
      cells.resize(count);
      sorted.resize(count);
      parallel_for(count, [&](std::size_t block, std::size_t end) {
        for (std::size_t i = block; i < end; ++i)
          cells[i] = cuts_.cell_of(place_of_record(from + i * records.record_bytes));
      });
      std::fill(place.begin(), place.end(), 0U);
      for (const std::uint32_t cell : cells) ++place[cell + 1];
      for (std::uint32_t cell = 0; cell < cuts_.cell_count(); ++cell) {
        if (place[cell + 1] > 0)
          extents[chunk].emplace_back(cell, Extent{.first = begin + place[cell], .count = place[cell + 1]});
        place[cell + 1] += place[cell];
      }
      for (std::size_t i = 0; i < count; ++i) {
        const std::byte* const record = from + i * records.record_bytes;
        const Vec3f p = place_of_record(record);
        const Vec3f n = records.has_normals() ? records.normal(record) : Vec3f(Vec3f::Zero());
        sorted[place[cells[i]]++] = {
            .index = begin + i, .position = {p.x(), p.y(), p.z()}, .normal = {n.x(), n.y(), n.z()}};
      }
      if (!write_all_at(spool.get(), std::as_bytes(std::span(sorted)), begin * sizeof(TileSample)))
        failure = errno;
      if (with_records) {
        const auto each = static_cast<std::size_t>(records.record_bytes);
        bytes.resize(count * each);
        for (std::size_t i = 0; i < count; ++i)
          std::memcpy(bytes.data() + i * each, first + sorted[i].index * each, each);
        if (!write_all_at(whole.get(), bytes, begin * each)) records_failure = errno;
      }
      file.release(records.begin + begin * records.record_bytes,
                   records.begin + (begin + count) * records.record_bytes);
    }
  };
  parallel_for(
      kChunksAtOnce, [&](std::size_t, std::size_t) { sort_chunks(); }, 1);
  if (failure == 0 && ::fsync(spool.get()) != 0) failure = errno;
  if (with_records && records_failure == 0 && ::fsync(whole.get()) != 0) records_failure = errno;
  struct Placed {
    std::uint64_t cell = 0;
    Extent extent;
  };
  std::vector<Placed> mine;
  for (const auto& of_chunk : extents)
    for (const auto& [cell, extent] : of_chunk) mine.push_back({.cell = cell, .extent = extent});
  extents_.assign(cuts_.cell_count(), {});
  for (const auto& bytes : team.gather(std::as_bytes(std::span(mine)))) {
    std::vector<Placed> theirs(bytes.size() / sizeof(Placed));
    if (!theirs.empty()) std::memcpy(theirs.data(), bytes.data(), bytes.size());
    for (const Placed& placed : theirs) extents_[placed.cell].push_back(placed.extent);
  }
  // In the scan's order, whoever sorted them.
  for (auto& list : extents_) std::ranges::sort(list, {}, &Extent::first);
  if (context.is_cancelled()) return cancelled_error();
  if (failure != 0) return file_error("cannot write", path, failure);
  if (records_failure != 0) return file_error("cannot write", records_path(folder_), records_failure);
  return {};
}

bool TileStore::read_cell(int spool, std::size_t cell, std::byte* to, std::size_t each) const {
  for (const Extent& extent : extents_[cell]) {
    std::uint64_t left = extent.count * each;
    std::uint64_t from = extent.first * each;
    while (left > 0) {
      const ssize_t got = ::pread(spool, to, static_cast<std::size_t>(left), static_cast<off_t>(from));
      if (got < 0 && errno == EINTR) continue;
      if (got == 0) errno = EIO;
      if (got <= 0) return false;
      to += got;
      from += static_cast<std::uint64_t>(got);
      left -= static_cast<std::uint64_t>(got);
    }
  }
  return true;
}

Result<std::vector<TileSample>> TileStore::read_around(
    std::size_t tile, const std::function<std::optional<Box3f>(std::span<const TileSample>)>& widened) const {
  const std::string path = spool_path(folder_);
  const Descriptor spool = opened(path, O_RDONLY);
  if (!spool.is_open()) return file_error("cannot read", path, errno);
  std::atomic<int> failure{0};  // errno
  const std::size_t first = cuts_.first_cell(tile);
  const std::size_t last = cuts_.first_cell(tile + 1);
  std::vector<std::size_t> place{0};
  for (std::size_t cell = first; cell < last; ++cell)
    place.push_back(place.back() + static_cast<std::size_t>(cell_samples(cell)));
  std::vector<TileSample> samples(place.back());
  parallel_for(
      last - first,
      [&](std::size_t begin, std::size_t end) {
        for (std::size_t k = begin; k < end; ++k)
          if (!read_cell(spool.get(), first + k, bytes_of(samples.data() + place[k]), sizeof(TileSample)))
            failure = errno;
      },
      1);
  if (failure != 0) return file_error("cannot read", path, failure);
  const std::optional<Box3f> wider = widened(samples);
  if (!wider) return samples;
  const Box3f& box = *wider;
  std::vector<std::uint32_t> others = cuts_.cells_in(box);
  std::erase_if(others, [&](std::uint32_t cell) { return cell >= first && cell < last; });
  std::vector<std::vector<TileSample>> around(others.size());
  parallel_for(
      others.size(),
      [&](std::size_t begin, std::size_t end) {
        std::vector<TileSample> all;
        for (std::size_t k = begin; k < end; ++k) {
          all.resize(static_cast<std::size_t>(cell_samples(others[k])));
          if (!read_cell(spool.get(), others[k], bytes_of(all.data()), sizeof(TileSample))) failure = errno;
          for (const TileSample& sample : all) {
            const Vec3f p = place_of(sample);
            if ((p.array() >= box.min.array()).all() && (p.array() <= box.max.array()).all())
              around[k].push_back(sample);
          }
        }
      },
      1);
  if (failure != 0) return file_error("cannot read", path, failure);
  for (const auto& more : around) samples.insert(samples.end(), more.begin(), more.end());
  return samples;
}

Result<std::vector<std::byte>> TileStore::own_records(std::size_t tile, std::size_t record_bytes) const {
  const auto samples = read_around(tile, [](std::span<const TileSample>) { return std::nullopt; });
  if (!samples) return samples.error();
  const std::string path = records_path(folder_);
  const Descriptor whole = opened(path, O_RDONLY);
  if (!whole.is_open()) return file_error("cannot read", path, errno);
  const std::size_t count = samples.value().size();
  std::vector<std::byte> by_cell(count * record_bytes);
  std::byte* to = by_cell.data();
  for (std::size_t cell = cuts_.first_cell(tile); cell < cuts_.first_cell(tile + 1); ++cell) {
    if (!read_cell(whole.get(), cell, to, record_bytes)) return file_error("cannot read", path, errno);
    to += cell_samples(cell) * record_bytes;
  }
  std::vector<std::uint32_t> order(count);
  for (std::size_t i = 0; i < count; ++i) order[i] = static_cast<std::uint32_t>(i);
  std::ranges::sort(order, {}, [&](std::uint32_t i) { return samples.value()[i].index; });
  std::vector<std::byte> records(by_cell.size());
  for (std::size_t i = 0; i < count; ++i)
    std::memcpy(records.data() + i * record_bytes, by_cell.data() + order[i] * record_bytes, record_bytes);
  return records;
}

Result<TileInput> TileStore::load(std::size_t tile, std::uint32_t rings, std::uint32_t neighbors,
                                  float least_ring, bool has_normals,
                                  const std::optional<Box3f>& scan) const {
  std::size_t own_count = 0;
  const auto read = read_around(tile, [&](std::span<const TileSample> own_samples) {
    own_count = own_samples.size();
    Points own(own_count);
    for_each(own_count, [&](std::size_t i) { own.set(i, place_of(own_samples[i])); });
    const std::vector<std::uint32_t> order = coherent_order(own);
    Points coherent(own_count);
    for_each(own_count, [&](std::size_t i) { coherent.set(i, own[order[i]]); });
    Box3f box = bounds_of(own);
    const float halo = static_cast<float>(rings) * ring_width(coherent, neighbors, least_ring);
    box.min.array() -= halo;
    box.max.array() += halo;
    return box;
  });
  if (!read) return read.error();
  const std::vector<TileSample>& samples = read.value();
  const std::size_t count = samples.size();
  // By index first: what follows must not depend on the order of tiles.
  std::vector<std::uint64_t> keys(count);
  std::vector<std::uint32_t> order(count);
  for_each(count, [&](std::size_t i) {
    keys[i] = samples[i].index;
    order[i] = static_cast<std::uint32_t>(i);
  });
  sort_by_key(keys, order);
  Points position(count + (scan ? 2 : 0));
  for_each(count, [&](std::size_t i) { position.set(i, place_of(samples[order[i]])); });
  if (scan) {
    position.set(count, scan->min);
    position.set(count + 1, scan->max);
  }
  std::vector<std::uint32_t> coherent = coherent_order(position);
  if (scan) std::erase_if(coherent, [count](std::uint32_t i) { return i >= count; });
  TileInput input;
  auto cloud = std::make_shared<Cloud>();
  cloud->origin = origin_;
  cloud->position.resize(count);
  if (has_normals) cloud->normal.resize(count);
  cloud->id.resize(count);
  input.index.resize(count);
  std::vector<std::uint32_t> place(count);  // in the cloud, of each by index
  for_each(count, [&](std::size_t i) {
    const TileSample& sample = samples[order[coherent[i]]];
    cloud->position.set(i, place_of(sample));
    if (has_normals) cloud->normal.set(i, {sample.normal[0], sample.normal[1], sample.normal[2]});
    cloud->id[i] = coherent[i];
    input.index[i] = sample.index;
    place[coherent[i]] = static_cast<std::uint32_t>(i);
  });
  input.by_index.reserve(own_count);
  for (std::size_t k = 0; k < count; ++k)
    if (order[k] < own_count) input.by_index.push_back(place[k]);
  input.cloud = std::move(cloud);
  return input;
}

std::string TileStore::result_path(std::size_t tile, std::size_t step) const {
  return folder_ + "/tile-" + std::to_string(tile) + "-" + std::to_string(step) + ".result";
}

bool TileStore::has_result(std::size_t tile, std::size_t step) const {
  struct stat status {};
  return ::stat(result_path(tile, step).c_str(), &status) == 0;
}

Result<void> TileStore::put_result(std::size_t tile, std::size_t step, const TileResult& result) const {
  std::vector<std::byte> bytes;
  const ResultHead head{.moved = result.moved.size(),
                        .removed = result.removed.size(),
                        .inserted = result.roots.size(),
                        .counts = result.counts.size(),
                        .matches = result.matches.size()};
  bytes.reserve(sizeof head + head.bytes() + result.records.size());
  append_raw(bytes, &head, 1);
  append_raw(bytes, result.moved.data(), result.moved.size());
  append_raw(bytes, result.removed.data(), result.removed.size());
  append_raw(bytes, result.roots.data(), result.roots.size());
  append_raw(bytes, result.counts.data(), result.counts.size());
  append_raw(bytes, result.matches.data(), result.matches.size());
  append_raw(bytes, result.records.data(), result.records.size());
  return write_file_atomically(result_path(tile, step), bytes);
}

Result<TileResultView> view_result(std::span<const std::byte> bytes) {
  ResultHead head;
  const Error malformed{
      .code = ErrorCode::kMalformedData, .message = "a tile's result is not whole", .field = "path"};
  if (bytes.size() < sizeof head) return malformed;
  std::memcpy(&head, bytes.data(), sizeof head);
  bytes = bytes.subspan(sizeof head);
  const std::uint64_t most = bytes.size();  // no count is more than that
  if (head.magic != kResultMagic || head.moved > most || head.removed > most || head.inserted > most ||
      head.counts > most || head.matches > most || head.bytes() > most)
    return malformed;
  const std::uint64_t records = most - head.bytes();
  if (head.inserted == 0 ? records > 0 : records % head.inserted != 0) return malformed;
  const auto take = [&]<typename T>(std::uint64_t count, T) {
    const auto taken = bytes.first(static_cast<std::size_t>(count) * sizeof(T));
    bytes = bytes.subspan(taken.size());
    return std::span(reinterpret_cast<const T*>(taken.data()), static_cast<std::size_t>(count));
  };
  TileResultView view;
  view.moved = take(head.moved, TileSample());
  view.removed = take(head.removed, std::uint64_t{});
  view.roots = take(head.inserted, std::uint64_t{});
  view.counts = take(head.counts, std::uint64_t{});
  view.matches = take(head.matches, PreviewMatch());
  view.records = bytes;
  // No scratch file is trusted to be what it was.
  const auto ascends = [](std::span<const std::uint64_t> numbers, auto in_order) {
    return std::ranges::adjacent_find(numbers, std::not_fn(in_order)) == numbers.end();
  };
  if (!ascends(view.removed, std::less<>()) || !ascends(view.roots, std::less_equal<>())) return malformed;
  return view;
}

}  // namespace pointwright::server

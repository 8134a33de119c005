#include "server/jobs/tile_store.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <limits>
#include <utility>

#include "engine/core/parallel.h"
#include "engine/spatial/block_tree.h"
#include "engine/spatial/coherent_order.h"
#include "server/base/descriptor.h"
#include "server/ingest/files.h"

namespace pointwright::server {
namespace {

constexpr std::uint64_t kChunk = std::uint64_t{1} << 21U;  // samples that are sorted together
constexpr std::uint64_t kIndexMagic = 0x31584449'54575054ULL;
constexpr std::uint64_t kResultMagic = 0x31534552'54575054ULL;
constexpr std::size_t kProbes = 64;  // blocks of samples whose neighbourhoods say how wide a ring is

Descriptor opened(const std::string& path, int flags) {
  return Descriptor(::open(path.c_str(), flags | O_CLOEXEC, 0600));
}

template <typename T>
void append(std::vector<std::byte>& bytes, const T* values, std::size_t count) {
  const std::size_t at = bytes.size();
  bytes.resize(at + count * sizeof(T));
  if (count > 0) std::memcpy(bytes.data() + at, values, count * sizeof(T));
}

std::string spool_path(const std::string& folder) {
  return folder + "/samples.bin";
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

Vec3f place_of(const TileSample& sample) {
  return {sample.position[0], sample.position[1], sample.position[2]};
}

}  // namespace

TileStore::TileStore(std::string folder, TileCuts cuts, const Vec3d& origin)
    : folder_(std::move(folder)), cuts_(std::move(cuts)), origin_(origin), extents_(cuts_.tile_count()) {}

std::uint64_t TileStore::sample_count(std::size_t tile) const {
  std::uint64_t count = 0;
  for (const Extent& extent : extents_[tile]) count += extent.count;
  return count;
}

std::vector<std::byte> TileStore::index_bytes() const {
  std::vector<std::byte> bytes;
  const std::array<std::uint64_t, 2> head{kIndexMagic, extents_.size()};
  append(bytes, head.data(), head.size());
  for (const auto& extents : extents_) {
    const std::uint64_t count = extents.size();
    append(bytes, &count, 1);
    append(bytes, extents.data(), extents.size());
  }
  return bytes;
}

bool TileStore::read_index() {
  const auto bytes = read_file(index_path(folder_), std::uint64_t{1} << 32U);
  if (!bytes) return false;
  std::span<const std::byte> rest = bytes.value();
  const auto take = [&](void* to, std::size_t size) {
    if (rest.size() < size) return false;
    std::memcpy(to, rest.data(), size);
    rest = rest.subspan(size);
    return true;
  };
  std::array<std::uint64_t, 2> head{};
  if (!take(head.data(), sizeof head) || head[0] != kIndexMagic || head[1] != cuts_.tile_count())
    return false;
  std::vector<std::vector<Extent>> extents(cuts_.tile_count());
  for (auto& list : extents) {
    std::uint64_t count = 0;
    if (!take(&count, sizeof count) || count > rest.size() / sizeof(Extent)) return false;
    list.resize(static_cast<std::size_t>(count));
    if (!take(list.data(), list.size() * sizeof(Extent))) return false;
  }
  if (!rest.empty()) return false;
  extents_ = std::move(extents);
  return true;
}

bool TileStore::is_sorted() {
  return read_index();
}

Result<void> TileStore::sort(const MappedFile& file, const ScanRecords& records,
                             const ExecutionContext& context) {
  const std::string path = spool_path(folder_);
  const Descriptor spool = opened(path, O_WRONLY | O_CREAT | O_TRUNC);
  if (!spool.is_open()) return file_error("cannot write", path, errno);
  extents_.assign(cuts_.tile_count(), {});
  const std::byte* const first = file.bytes().data() + records.begin;
  std::vector<std::uint32_t> tiles;
  std::vector<TileSample> unsorted;
  std::vector<TileSample> sorted;
  std::vector<std::uint64_t> place(cuts_.tile_count() + 1);
  for (std::uint64_t begin = 0; begin < records.count; begin += kChunk) {
    if (context.is_cancelled()) return cancelled_error();
    const std::uint64_t end = std::min(records.count, begin + kChunk);
    const auto count = static_cast<std::size_t>(end - begin);
    tiles.resize(count);
    unsorted.resize(count);
    sorted.resize(count);
    parallel_for(count, [&](std::size_t from, std::size_t to) {
      for (std::size_t i = from; i < to; ++i) {
        const std::byte* const record = first + (begin + i) * records.record_bytes;
        // At origin 0 the cast alone keeps a negative zero.
        const Vec3d p = records.position(record);
        const Vec3f q = Vec3d((origin_.array() == 0.0).select(p, p - origin_)).cast<float>();
        const Vec3f n = records.has_normals() ? records.normal(record) : Vec3f(Vec3f::Zero());
        unsorted[i] = {
            .index = begin + i, .position = {q.x(), q.y(), q.z()}, .normal = {n.x(), n.y(), n.z()}};
        tiles[i] = cuts_.tile_of(q);
      }
    });
    std::fill(place.begin(), place.end(), 0U);
    for (const std::uint32_t tile : tiles) ++place[tile + 1];
    for (std::size_t tile = 0; tile < cuts_.tile_count(); ++tile) {
      if (place[tile + 1] > 0)
        extents_[tile].push_back({.first = begin + place[tile], .count = place[tile + 1]});
      place[tile + 1] += place[tile];
    }
    for (std::size_t i = 0; i < count; ++i) sorted[place[tiles[i]]++] = unsorted[i];
    if (!write_all(spool.get(), std::as_bytes(std::span(sorted))))
      return file_error("cannot write", path, errno);
    file.release(records.begin + begin * records.record_bytes, records.begin + end * records.record_bytes);
  }
  if (::fsync(spool.get()) != 0) return file_error("cannot write", path, errno);
  return write_file_atomically(index_path(folder_), index_bytes());
}

Result<void> TileStore::read_samples(std::size_t tile, std::vector<TileSample>& samples) const {
  const std::string path = spool_path(folder_);
  const Descriptor spool = opened(path, O_RDONLY);
  if (!spool.is_open()) return file_error("cannot read", path, errno);
  std::size_t at = samples.size();
  samples.resize(at + static_cast<std::size_t>(sample_count(tile)));
  for (const Extent& extent : extents_[tile]) {
    auto* to = reinterpret_cast<char*>(samples.data() + at);
    std::uint64_t left = extent.count * sizeof(TileSample);
    std::uint64_t from = extent.first * sizeof(TileSample);
    while (left > 0) {
      const ssize_t got = ::pread(spool.get(), to, static_cast<std::size_t>(left), static_cast<off_t>(from));
      if (got < 0 && errno == EINTR) continue;
      if (got <= 0) {
        if (got == 0) errno = EIO;
        return file_error("cannot read", path, errno);
      }
      to += got;
      from += static_cast<std::uint64_t>(got);
      left -= static_cast<std::uint64_t>(got);
    }
    at += static_cast<std::size_t>(extent.count);
  }
  return {};
}

Result<TileInput> TileStore::load(std::size_t tile, std::uint32_t rings, std::uint32_t neighbors,
                                  float least_ring, bool has_normals) const {
  std::vector<TileSample> samples;
  if (auto read = read_samples(tile, samples); !read) return read.error();
  TileInput input;
  input.own = samples.size();
  Points own(samples.size());
  Box3f box;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    own.set(i, place_of(samples[i]));
    box.extend(own[i]);
  }
  const std::vector<std::uint32_t> own_order = coherent_order(own);
  Points coherent(own.size());
  for (std::size_t i = 0; i < own.size(); ++i) coherent.set(i, own[own_order[i]]);
  const float halo = static_cast<float>(rings) * ring_width(coherent, neighbors, least_ring);
  box.min.array() -= halo;
  box.max.array() += halo;
  std::vector<TileSample> others;
  for (const std::uint32_t other : cuts_.tiles_in(box)) {
    if (other == tile) continue;
    others.clear();
    if (auto read = read_samples(other, others); !read) return read.error();
    for (const TileSample& sample : others) {
      const Vec3f p = place_of(sample);
      if ((p.array() >= box.min.array()).all() && (p.array() <= box.max.array()).all())
        samples.push_back(sample);
    }
  }
  // By index first: what follows must not depend on the order of tiles.
  std::vector<std::uint8_t> is_own(samples.size(), 0);
  std::fill_n(is_own.begin(), input.own, std::uint8_t{1});
  std::vector<std::uint64_t> keys(samples.size());
  std::vector<std::uint32_t> order(samples.size());
  for (std::size_t i = 0; i < samples.size(); ++i) {
    keys[i] = samples[i].index;
    order[i] = static_cast<std::uint32_t>(i);
  }
  sort_by_key(keys, order);
  auto cloud = std::make_shared<Cloud>();
  cloud->origin = origin_;
  Points position(samples.size());
  for (std::size_t i = 0; i < samples.size(); ++i) position.set(i, place_of(samples[order[i]]));
  const std::vector<std::uint32_t> coherent_all = coherent_order(position);
  cloud->position.resize(samples.size());
  if (has_normals) cloud->normal.resize(samples.size());
  cloud->id.resize(samples.size());
  input.index.resize(samples.size());
  input.is_own.resize(samples.size());
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const TileSample& sample = samples[order[coherent_all[i]]];
    cloud->position.set(i, place_of(sample));
    if (has_normals) cloud->normal.set(i, {sample.normal[0], sample.normal[1], sample.normal[2]});
    cloud->id[i] = static_cast<std::uint32_t>(i);
    input.index[i] = sample.index;
    input.is_own[i] = is_own[order[coherent_all[i]]];
  }
  input.cloud = std::move(cloud);
  return input;
}

std::string TileStore::result_path(std::size_t tile) const {
  return folder_ + "/tile-" + std::to_string(tile) + ".result";
}

bool TileStore::has_result(std::size_t tile) const {
  struct stat status {};
  return ::stat(result_path(tile).c_str(), &status) == 0;
}

Result<void> TileStore::put_result(std::size_t tile, const TileResult& result) const {
  std::vector<std::byte> bytes;
  bytes.reserve(24 + result.moved.size() * sizeof(TileSample) + result.matches.size() * sizeof(PreviewMatch));
  const std::array<std::uint64_t, 3> head{kResultMagic, result.moved.size(), result.matches.size()};
  append(bytes, head.data(), head.size());
  append(bytes, result.moved.data(), result.moved.size());
  append(bytes, result.matches.data(), result.matches.size());
  return write_file_atomically(result_path(tile), bytes);
}

Result<TileResultView> view_result(std::span<const std::byte> bytes) {
  std::array<std::uint64_t, 3> head{};
  const Error malformed{
      .code = ErrorCode::kMalformedData, .message = "a tile's result is not whole", .field = "path"};
  if (bytes.size() < sizeof head) return malformed;
  std::memcpy(head.data(), bytes.data(), sizeof head);
  const std::uint64_t room = bytes.size() - sizeof head;
  if (head[0] != kResultMagic || head[1] > room / sizeof(TileSample) ||
      head[2] != (room - head[1] * sizeof(TileSample)) / sizeof(PreviewMatch))
    return malformed;
  const std::byte* const moved = bytes.data() + sizeof head;
  const std::byte* const matches = moved + head[1] * sizeof(TileSample);
  return TileResultView{
      .moved = {reinterpret_cast<const TileSample*>(moved), static_cast<std::size_t>(head[1])},
      .matches = {reinterpret_cast<const PreviewMatch*>(matches), static_cast<std::size_t>(head[2])}};
}

}  // namespace pointwright::server

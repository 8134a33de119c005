#include "server/sessions/surface_hash.h"

#include <algorithm>
#include <array>
#include <cstring>

#include "engine/core/parallel.h"
#include "server/base/sha256.h"

namespace pointwright::server {
namespace {

constexpr std::size_t kBlock = 16 * 1024;
constexpr std::size_t kBytesPerSample = 7 * 4;

/// One sample's columns after the other, in little-endian as every machine that we compile for has them.
void append(std::vector<std::byte>& bytes, const void* values, std::size_t count) {
  const auto* const begin = static_cast<const std::byte*>(values);
  bytes.insert(bytes.end(), begin, begin + 4 * count);
}

}  // namespace

std::string surface_hash(const SurfaceState& state) {
  const Level& finest = state.surface->finest();
  const std::vector<std::uint32_t>& id = state.samples->cloud().id;
  const std::size_t count = finest.position.size();
  const std::size_t blocks = (count + kBlock - 1) / kBlock;
  std::vector<std::string> hashes(blocks);
  parallel_for(
      blocks,
      [&](std::size_t begin, std::size_t end) {
        std::vector<std::byte> bytes;
        bytes.reserve(kBlock * kBytesPerSample);
        for (std::size_t b = begin; b < end; ++b) {
          bytes.clear();
          const std::size_t first = b * kBlock;
          const std::size_t size = std::min(kBlock, count - first);
          for (const Points* points : {&finest.position, &finest.normal})
            for (const float* column : {points->x(), points->y(), points->z()})
              append(bytes, column + first, size);
          append(bytes, id.data() + first, size);
          hashes[b] = sha256_hex(bytes);
        }
      },
      1);
  std::string all = "pointwright surface " + std::to_string(count) + "\n";
  for (const std::string& hash : hashes) all += hash;
  return sha256_hex(std::as_bytes(std::span(all.data(), all.size())));
}

}  // namespace pointwright::server

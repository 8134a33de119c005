// The decoder's side of confined.h: give everything up, then decode.
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <exception>
#include <new>

#include "engine/io/cloud_blob.h"
#include "engine/io/decoded_cloud.h"
#include "engine/io/draco_gate.h"
#include "engine/io/draco_tiles.h"
#include "engine/io/pcd.h"
#include "server/ingest/confined.h"
#include "server/ingest/exchange_record.h"
#include "server/ingest/png_reader.h"
#include "server/ingest/sandbox.h"

namespace pointwright {
namespace {

constexpr int kAnswered = 0;
constexpr int kNoRequest = 2;
constexpr int kNotConfined = 3;
constexpr int kNotWritten = 4;

constexpr std::uint64_t kMiB = std::uint64_t{1} << 20;

// Writes all of the piece; leaves the process where that fails (the daemon then sees no whole answer).
void write_all(std::span<const std::byte> piece) {
  while (!piece.empty()) {
    const ssize_t written = write(kAnswerDescriptor, piece.data(), piece.size());
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) _exit(kNotWritten);
    piece = piece.subspan(static_cast<std::size_t>(written));
  }
}

// One tile's file, then the columns of all: tile by tile first, then together.
std::uint64_t memory_for_tiles(std::span<const std::byte> bytes, const ImportParams& params) {
  std::uint64_t all = 64 * kMiB;
  auto reader = DracoTilesReader::open(bytes, params.max_samples);
  if (!reader) return all;
  while (true) {
    const auto piece = reader.value().next();
    if (!piece || !piece.value()) return all;
    const auto claim = draco_gate(piece.value()->bytes, params.max_samples);
    if (!claim) return all;
    all += piece.value()->bytes.size() + claim.value().faces * 256 +
           claim.value().points * (96 + 8 * claim.value().sample_bytes);
  }
}

// What decoding may need beyond the bytes themselves. Scans were measured to take a quarter of it (Draco: 40
// bytes a sample of 15; text of long numbers: twice its bytes); text of one-digit numbers takes nearly all.
std::uint64_t memory_for(std::span<const std::byte> bytes, CloudFormat format, const ImportParams& params) {
  if (format == CloudFormat::kPcd) {
    // Compressed ones expand to up to 88 times their bytes: the expanded bytes, and the columns from them.
    const auto header = parse_pcd_header(bytes, params.max_samples);
    if (!header) return 64 * kMiB;
    const PcdHeader& h = header.value();
    return 64 * kMiB + 24 * bytes.size() + h.points * (64 + 3 * h.row_bytes());
  }
  if (format == CloudFormat::kDracoTiles) return memory_for_tiles(bytes, params);
  if (format != CloudFormat::kDraco) return 64 * kMiB + 24 * bytes.size();
  const auto claim = draco_gate(bytes, params.max_samples);
  if (!claim) return 64 * kMiB;
  const DracoClaim& c = claim.value();
  if (c.is_mesh) return 64 * kMiB + 256 * (c.points + c.faces);
  return 64 * kMiB + c.points * (64 + 4 * c.sample_bytes);
}

// The image itself, libpng's rows and tables, and what inflating takes.
std::uint64_t memory_for_image(std::span<const std::byte> bytes, const ImageLimits& limits) {
  const auto claim = png_gate(bytes, limits);
  if (!claim) return 64 * kMiB;
  return 64 * kMiB + claim.value().value_bytes + std::uint64_t{claim.value().height} * 16 +
         std::uint64_t{claim.value().width} * 64;
}

// What reading gives, or why it gives nothing.
template <typename Read>
auto guarded(const Read& read) -> decltype(read()) {
  try {
    return read();
  } catch (const std::bad_alloc&) {
    return Error{.code = ErrorCode::kTooLarge,
                 .message = "decoding the file takes more memory than its size warrants",
                 .field = {}};
  } catch (const std::exception&) {
    return Error{.code = ErrorCode::kMalformedData, .message = "the file cannot be decoded", .field = {}};
  }
}

CloudFormat cloud_format(const DecodeRequest& request) {
  return static_cast<CloudFormat>(request.format);
}
ImportParams import_params(const DecodeRequest& request) {
  return {.max_samples = request.max_samples, .drop_non_finite = request.drop_non_finite != 0};
}
ImageLimits image_limits(const DecodeRequest& request) {
  return {.max_side = request.max_side, .max_pixels = request.max_pixels};
}

void answer_cloud(std::span<const std::byte> bytes, const DecodeRequest& request) {
  const auto cloud =
      guarded([&] { return decode_cloud(bytes, cloud_format(request), import_params(request)); });
  if (!cloud) return write_all(error_answer(cloud.error()));
  const auto kind = AnswerKind::kCloud;
  write_all(std::as_bytes(std::span(&kind, 1)));
  write_cloud_blob(cloud.value(), write_all);
}

void answer_image(std::span<const std::byte> bytes, const DecodeRequest& request) {
  const auto read = guarded([&] { return read_png(bytes, image_limits(request)); });
  if (!read) return write_all(error_answer(read.error()));
  const Image& image = read.value();
  const ImageHead head{.width = image.width,
                       .height = image.height,
                       .channels = image.channels,
                       .bytes_per_value = image.bytes_per_value};
  write_all(std::as_bytes(std::span(&head, 1)));
  write_all(image.values);
}

}  // namespace

int decode_child_main() {
  DecodeRequest request;
  struct stat info {};
  const bool is_asked = fstat(kInputDescriptor, &info) == 0 &&
                        pread(kRequestDescriptor, &request, sizeof(request), 0) == sizeof(request) &&
                        request.magic == DecodeRequest::kMagic && request.byte_count > 0 &&
                        static_cast<std::uint64_t>(info.st_size) == request.byte_count;
  if (!is_asked) return kNoRequest;
  const auto length = static_cast<std::size_t>(info.st_size);
  void* mapped = mmap(nullptr, length, PROT_READ, MAP_PRIVATE, kInputDescriptor, 0);
  if (mapped == MAP_FAILED) return kNoRequest;
  const std::span<const std::byte> bytes(static_cast<const std::byte*>(mapped), length);
  const bool is_image = request.subject == DecodeSubject::kImage;

  const std::uint64_t base = address_space_bytes();
  const bool is_confined = limit_resources(request.cpu_seconds, request.memory_bytes) &&
                           limit_address_space(base, request.memory_bytes) && forbid_system_calls();
  if (!is_confined) return kNotConfined;
  // From here on the bytes may be looked at.
  const std::uint64_t needed = is_image ? memory_for_image(bytes, image_limits(request))
                                        : memory_for(bytes, cloud_format(request), import_params(request));
  if (!limit_address_space(base, std::min(needed, request.memory_bytes))) return kNotConfined;
  if (is_image) {
    answer_image(bytes, request);
  } else {
    answer_cloud(bytes, request);
  }
  _exit(kAnswered);
}

}  // namespace pointwright

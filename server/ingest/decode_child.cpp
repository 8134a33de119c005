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
#include "server/ingest/confined.h"
#include "server/ingest/exchange_record.h"
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

// What decoding may need beyond the bytes themselves. Scans were measured to take a quarter of it (Draco: 40
// bytes a sample of 15; text of long numbers: twice its bytes); text of one-digit numbers takes nearly all.
std::uint64_t memory_for(std::span<const std::byte> bytes, CloudFormat format, const ImportParams& params) {
  if (format != CloudFormat::kDraco) return 64 * kMiB + 24 * bytes.size();
  const auto claim = draco_gate(bytes, params.max_samples);
  if (!claim) return 64 * kMiB;
  const DracoClaim& c = claim.value();
  if (c.is_mesh) return 64 * kMiB + 256 * (c.points + c.faces);
  return 64 * kMiB + c.points * (64 + 4 * c.sample_bytes);
}

Result<ImportedCloud> decode(std::span<const std::byte> bytes, CloudFormat format,
                             const ImportParams& params) {
  try {
    return decode_cloud(bytes, format, params);
  } catch (const std::bad_alloc&) {
    return Error{.code = ErrorCode::kTooLarge,
                 .message = "decoding the file takes more memory than its size warrants",
                 .field = {}};
  } catch (const std::exception&) {
    return Error{.code = ErrorCode::kMalformedData, .message = "the file cannot be decoded", .field = {}};
  }
}

}  // namespace

int decode_child_main() {
  DecodeRequest request;
  struct stat info {};
  const bool is_asked = fstat(kRequestDescriptor, &info) == 0 &&
                        pread(kRequestDescriptor, &request, sizeof(request), 0) == sizeof(request) &&
                        request.magic == DecodeRequest::kMagic &&
                        static_cast<std::uint64_t>(info.st_size) == sizeof(request) + request.byte_count;
  if (!is_asked) return kNoRequest;
  const auto length = static_cast<std::size_t>(info.st_size);
  void* mapped = mmap(nullptr, length, PROT_READ, MAP_PRIVATE, kRequestDescriptor, 0);
  if (mapped == MAP_FAILED) return kNoRequest;
  const std::span<const std::byte> bytes(static_cast<const std::byte*>(mapped) + sizeof(request),
                                         request.byte_count);
  const auto format = static_cast<CloudFormat>(request.format);
  const ImportParams params{.max_samples = request.max_samples,
                            .drop_non_finite = request.drop_non_finite != 0};

  const std::uint64_t base = address_space_bytes();
  const bool is_confined = limit_resources(request.cpu_seconds, request.memory_bytes) &&
                           limit_address_space(base, request.memory_bytes) && forbid_system_calls();
  if (!is_confined) return kNotConfined;
  // From here on the bytes may be looked at.
  const std::uint64_t needed = memory_for(bytes, format, params);
  if (!limit_address_space(base, std::min(needed, request.memory_bytes))) return kNotConfined;
  const auto result = decode(bytes, format, params);
  if (!result) {
    write_all(error_answer(result.error()));
  } else {
    const auto kind = AnswerKind::kCloud;
    write_all(std::as_bytes(std::span(&kind, 1)));
    write_cloud_blob(result.value(), write_all);
  }
  _exit(kAnswered);
}

}  // namespace pointwright

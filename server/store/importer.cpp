#include "server/store/importer.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "engine/io/decoded_cloud.h"
#include "server/base/random_id.h"
#include "server/base/sha256.h"
#include "server/ingest/confined.h"
#include "server/ingest/files.h"

namespace pointwright::server {

using protocol::Problem;
using protocol::ProblemKind;

Decoder confined_decoder(std::shared_ptr<DecodeSlots> slots) {
  return [slots = std::move(slots)](std::span<const std::byte> bytes, CloudFormat format,
                                    const ImportParams& params, const ExecutionContext* context) {
    ConfineLimits confine;
    confine.slots = slots.get();
    return decode_confined(bytes, format, params, confine, context);
  };
}

FileDecoder confined_file_decoder(std::shared_ptr<DecodeSlots> slots) {
  return [slots = std::move(slots)](int file, std::uint64_t byte_count, CloudFormat format,
                                    const ImportParams& params, const ExecutionContext* context) {
    constexpr double kBytesPerSecond = 16.0 * 1024 * 1024;
    ConfineLimits confine;
    confine.slots = slots.get();
    confine.deadline_seconds += static_cast<double>(byte_count) / kBytesPerSecond;
    return decode_confined(file, byte_count, format, params, confine, context);
  };
}

namespace {

/// Enough of a file to know its format by.
constexpr std::uint64_t kStartBytes = std::uint64_t{1} << 20U;

Result<CloudFormat> format_of(std::span<const std::byte> start, const ImportRequest& request) {
  if (request.format) return *request.format;
  if (request.media_type == "model/x-draco") return CloudFormat::kDraco;
  if (request.media_type == "application/x-ply") return CloudFormat::kPly;
  if (request.media_type == "text/plain") return CloudFormat::kXyz;
  if (request.media_type == "model/obj") return CloudFormat::kObj;
  if (request.media_type == "model/x-pcd") return CloudFormat::kPcd;
  if (request.media_type == "application/vnd.las") return CloudFormat::kLas;
  if (request.media_type == "application/zip") return CloudFormat::kDracoTiles;
  return detect_format(start);
}

/// The decoded cloud in order, or why there is none.
Outcome<ImportedCloud> finished(ComputePool& pool, Result<ImportedCloud> decoded,
                                const ImportParams& params) {
  if (!decoded) {
    if (decoded.error().field == "decoder")
      return Problem{.kind = ProblemKind::kOverloaded, .detail = decoded.error().message};
    return protocol::to_problem(decoded.error());
  }
  auto finished = computed(pool, [&] { return finish_cloud(std::move(decoded).value(), params); });
  if (!finished.ok()) return finished.problem();
  if (!finished.value()) return protocol::to_problem(finished.value().error());
  return std::move(finished.value()).value();
}

/// What was uploaded, and how to decode it.
struct Source {
  std::span<const std::byte> start;  ///< enough to know the format by
  BlobContent content;
  std::function<Result<ImportedCloud>(CloudFormat, const ImportParams&)> decode;
  std::function<Outcome<std::string>()> sha256;
};

Outcome<SharedCloud> import_source(CloudStore& store, ComputePool& pool, const Limits& limits,
                                   const Source& source, const ImportRequest& request,
                                   const Seal<protocol::CloudDocument>& seal,
                                   const ExecutionContext* context) {
  const auto begins = [&](const char* phase, double done) {
    if (context == nullptr) return true;
    context->begin_phase(phase, done);
    return !context->is_cancelled();
  };
  if (source.content.size == 0)
    return Problem{.kind = ProblemKind::kEmptyBody, .detail = "the upload has no bytes"};
  const auto format = format_of(source.start, request);
  if (!format) return protocol::to_problem(format.error());
  const ImportParams params{.max_samples = limits.max_samples, .drop_non_finite = request.drop_non_finite};
  if (!begins("decoding", 0.05)) return protocol::to_problem(cancelled_error());
  auto decoded = source.decode(format.value(), params);
  if (!begins("ordering", 0.6)) return protocol::to_problem(cancelled_error());
  auto imported = finished(pool, std::move(decoded), params);
  if (!imported.ok()) return imported.problem();
  if (!begins("hashing", 0.8)) return protocol::to_problem(cancelled_error());
  const auto sha256 = source.sha256();
  if (!sha256.ok()) return sha256.problem();
  if (!begins("storing", 0.9)) return protocol::to_problem(cancelled_error());
  NewCloud cloud{.document = {.id = random_id(),
                              .name = request.name,
                              .sha256 = sha256.value(),
                              .bytes = source.content.size,
                              .created = std::chrono::system_clock::now(),
                              .origin = imported.value().cloud.origin,
                              .report = imported.value().report},
                 .cloud = std::move(imported.value().cloud),
                 .source = {.format = format.value(), .drop_non_finite = request.drop_non_finite},
                 .owner = request.owner,
                 .quota = request.quota};
  return store.add(std::move(cloud), source.content, seal);
}

Problem unreadable() {
  return {.kind = ProblemKind::kInternalError, .detail = "the upload cannot be read from the disk"};
}

}  // namespace

CloudLoader cloud_loader(FileDecoder decode_file, Decoder decode, ComputePool& pool, const Limits& limits) {
  return [decode_file = std::move(decode_file), decode = std::move(decode), &pool, most = limits.max_samples](
             const BlobContent& file, const CloudSource& source) -> Outcome<Cloud> {
    const ImportParams params{.max_samples = most, .drop_non_finite = source.drop_non_finite};
    std::vector<std::byte> bytes;
    if (!decode_file && !read_pieces(file.file, file.size, [&](std::span<const std::byte> piece) {
          bytes.insert(bytes.end(), piece.begin(), piece.end());
          return true;
        }))
      return unreadable();
    auto imported = finished(pool,
                             decode_file ? decode_file(file.file, file.size, source.format, params, nullptr)
                                         : decode(bytes, source.format, params, nullptr),
                             params);
    if (!imported.ok()) return imported.problem();
    return std::move(imported.value().cloud);
  };
}

Outcome<SharedCloud> import_cloud(CloudStore& store, const Decoder& decode, ComputePool& pool,
                                  const Limits& limits, std::span<const std::byte> bytes,
                                  const ImportRequest& request, const Seal<protocol::CloudDocument>& seal,
                                  const ExecutionContext* context) {
  const Source source{
      .start = bytes,
      .content = bytes,
      .decode = [&](CloudFormat format,
                    const ImportParams& params) { return decode(bytes, format, params, context); },
      .sha256 = [&] { return Outcome<std::string>(sha256_hex(bytes)); }};
  return import_source(store, pool, limits, source, request, seal, context);
}

Outcome<SharedCloud> import_cloud(CloudStore& store, const FileDecoder& decode_file, const Decoder& decode,
                                  ComputePool& pool, const Limits& limits, const BlobContent& file,
                                  const ImportRequest& request, const Seal<protocol::CloudDocument>& seal,
                                  const ExecutionContext* context) {
  std::vector<std::byte> start;
  const auto append = [&](std::span<const std::byte> piece) {
    start.insert(start.end(), piece.begin(), piece.end());
    return true;
  };
  const std::uint64_t looked = decode_file ? std::min<std::uint64_t>(file.size, kStartBytes) : file.size;
  if (!read_pieces(file.file, looked, append)) return unreadable();
  const auto hash = [&]() -> Outcome<std::string> {
    Digest digest(Digest::Algorithm::kSha256);
    const auto add = [&](std::span<const std::byte> piece) {
      digest.add(piece);
      return true;
    };
    if (!read_pieces(file.file, file.size, add)) return unreadable();
    return to_hex(digest.finish());
  };
  const auto decode_it = [&](CloudFormat format, const ImportParams& params) {
    return decode_file ? decode_file(file.file, file.size, format, params, context)
                       : decode(start, format, params, context);
  };
  const Source source{.start = start, .content = file, .decode = decode_it, .sha256 = hash};
  return import_source(store, pool, limits, source, request, seal, context);
}

}  // namespace pointwright::server

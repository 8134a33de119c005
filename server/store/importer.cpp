#include "server/store/importer.h"

#include <utility>

#include "engine/io/decoded_cloud.h"
#include "server/base/random_id.h"
#include "server/ingest/confined.h"
#include "server/store/sha256.h"

namespace pointwright::server {

using protocol::Problem;
using protocol::ProblemKind;

Decoder confined_decoder(std::shared_ptr<DecodeSlots> slots) {
  return [slots = std::move(slots)](std::span<const std::byte> bytes, CloudFormat format,
                                    const ImportParams& params) {
    ConfineLimits confine;
    confine.slots = slots.get();
    return decode_confined(bytes, format, params, confine);
  };
}

namespace {

Result<CloudFormat> format_of(std::span<const std::byte> bytes, const std::string& media_type) {
  if (media_type == "model/x-draco") return CloudFormat::kDraco;
  if (media_type == "application/x-ply") return CloudFormat::kPly;
  if (media_type == "text/plain") return CloudFormat::kXyz;
  return detect_format(bytes);
}

}  // namespace

Outcome<SharedCloud> import_cloud(CloudStore& store, const Decoder& decode, ComputePool& pool,
                                  const Limits& limits, std::span<const std::byte> bytes,
                                  const ImportRequest& request) {
  if (bytes.empty()) return Problem{.kind = ProblemKind::kEmptyBody, .detail = "the upload has no bytes"};
  const auto format = format_of(bytes, request.media_type);
  if (!format) return protocol::to_problem(format.error());
  const ImportParams params{.max_samples = limits.max_samples, .drop_non_finite = request.drop_non_finite};
  auto decoded = decode(bytes, format.value(), params);
  if (!decoded) {
    if (decoded.error().field == "decoder")
      return Problem{.kind = ProblemKind::kOverloaded, .detail = decoded.error().message};
    return protocol::to_problem(decoded.error());
  }
  auto finished = computed(pool, [&] { return finish_cloud(std::move(decoded).value(), params); });
  if (!finished.ok()) return finished.problem();
  Result<ImportedCloud>& imported = finished.value();
  if (!imported) return protocol::to_problem(imported.error());
  protocol::CloudDocument document{.id = random_id(),
                                   .name = request.name,
                                   .sha256 = sha256_hex(bytes),
                                   .bytes = bytes.size(),
                                   .created = std::chrono::system_clock::now(),
                                   .origin = imported.value().cloud.origin,
                                   .report = imported.value().report};
  return store.add(std::move(document), std::move(imported.value().cloud));
}

}  // namespace pointwright::server

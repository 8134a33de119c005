#include "server/store/importer.h"

#include "server/base/random_id.h"
#include "server/ingest/confined.h"
#include "server/store/sha256.h"

namespace pointwright::server {

using protocol::Problem;
using protocol::ProblemKind;

Decoder confined_decoder(const Limits& limits) {
  auto slots = std::make_shared<DecodeSlots>(static_cast<int>(limits.max_decoders));
  return [slots](std::span<const std::byte> bytes, CloudFormat format, const ImportParams& params) {
    ConfineLimits confine;
    confine.slots = slots.get();
    return read_confined(bytes, format, params, confine);
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

Outcome<SharedCloud> import_cloud(CloudStore& store, const Decoder& decode, const Limits& limits,
                                  std::span<const std::byte> bytes, const ImportRequest& request) {
  if (bytes.empty()) return Problem{.kind = ProblemKind::kEmptyBody, .detail = "the upload has no bytes"};
  const auto format = format_of(bytes, request.media_type);
  if (!format) return protocol::to_problem(format.error());
  auto imported =
      decode(bytes, format.value(),
             ImportParams{.max_samples = limits.max_samples, .drop_non_finite = request.drop_non_finite});
  if (!imported) {
    if (imported.error().field == "decoder")
      return Problem{.kind = ProblemKind::kOverloaded, .detail = imported.error().message};
    return protocol::to_problem(imported.error());
  }
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

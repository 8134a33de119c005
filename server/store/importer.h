#pragma once
// From uploaded bytes to a stored cloud.

#include <functional>
#include <memory>
#include <span>
#include <string>

#include "engine/io/cloud_io.h"
#include "server/ingest/decode_slots.h"
#include "server/sessions/compute_pool.h"
#include "server/store/cloud_store.h"

namespace pointwright::server {

/// decode_cloud(): in a confined process in the daemon, in this one in tests.
using Decoder =
    std::function<Result<ImportedCloud>(std::span<const std::byte>, CloudFormat, const ImportParams&)>;

/// The confined decoder; the slots are those of all decoders.
Decoder confined_decoder(std::shared_ptr<DecodeSlots> slots);

struct ImportRequest {
  std::string name;
  std::string media_type;  ///< says the format; application/octet-stream or empty: found by looking
  bool drop_non_finite = false;
};

/// Decodes, puts the cloud in order on `pool`, and stores it. Blocks until that is done.
/// Problems: empty body, everything that decoding refuses, too many clouds, out of space, overloaded.
Outcome<SharedCloud> import_cloud(CloudStore& store, const Decoder& decode, ComputePool& pool,
                                  const Limits& limits, std::span<const std::byte> bytes,
                                  const ImportRequest& request);

}  // namespace pointwright::server

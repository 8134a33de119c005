#pragma once
// From uploaded bytes to a stored cloud.

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "engine/core/execution_context.h"
#include "engine/io/cloud_io.h"
#include "server/ingest/decode_slots.h"
#include "server/sessions/compute_pool.h"
#include "server/store/cloud_store.h"

namespace pointwright::server {

/// decode_cloud(): in a confined process in the daemon, in this one in tests.
/// The context, where there is one, ends it.
using Decoder = std::function<Result<ImportedCloud>(std::span<const std::byte>, CloudFormat,
                                                    const ImportParams&, const ExecutionContext*)>;

/// The same for an open file of so many bytes.
using FileDecoder = std::function<Result<ImportedCloud>(int, std::uint64_t, CloudFormat, const ImportParams&,
                                                        const ExecutionContext*)>;

/// The confined decoder; the slots are those of all decoders.
Decoder confined_decoder(std::shared_ptr<DecodeSlots> slots);
/// A long file has longer: a second for every 16 MiB beyond the ordinary deadline.
FileDecoder confined_file_decoder(std::shared_ptr<DecodeSlots> slots);

struct ImportRequest {
  std::string name;
  std::string media_type;  ///< says the format; application/octet-stream or empty: found by looking
  bool drop_non_finite = false;
  std::optional<CloudFormat> format = std::nullopt;  ///< says the format before all else
  std::string owner = {};                            ///< as in StoredCloud
  std::shared_ptr<const void> quota = {};
};

/// How stored clouds are made of their files once more: as import_cloud() does.
CloudLoader cloud_loader(FileDecoder decode_file, Decoder decode, ComputePool& pool, const Limits& limits);

/// Decodes, puts the cloud in order on `pool`, and stores it. Blocks until that is done. The context, where
/// there is one, is told how far it is.
/// Problems: empty body, everything that decoding refuses, overloaded; cancelled (nothing is stored then);
/// those of CloudStore::add().
Outcome<SharedCloud> import_cloud(CloudStore& store, const Decoder& decode, ComputePool& pool,
                                  const Limits& limits, std::span<const std::byte> bytes,
                                  const ImportRequest& request,
                                  const Seal<protocol::CloudDocument>& seal = {},
                                  const ExecutionContext* context = nullptr);

/// The same from a file of the data folder that does not change any more: its bytes are not held in memory
/// where there is a `decode_file`.
Outcome<SharedCloud> import_cloud(CloudStore& store, const FileDecoder& decode_file, const Decoder& decode,
                                  ComputePool& pool, const Limits& limits, const BlobContent& file,
                                  const ImportRequest& request,
                                  const Seal<protocol::CloudDocument>& seal = {},
                                  const ExecutionContext* context = nullptr);

}  // namespace pointwright::server

#pragma once
// Untrusted files of clouds and images are decoded in a process of their own that may do nothing but compute,
// and may die of it.
//
// The daemon starts itself anew (/proc/self/exe --decode-child): no file, socket, thread or program can be
// reached from there, memory, time and output are bounded, and the only things shared are the bytes in, the
// decoded columns out, and a pipe that says when it is over. The columns are checked like any other foreign
// bytes. Ordering, recentring and counting (finish_cloud()) are the caller's: the child may start no threads.

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "engine/core/execution_context.h"
#include "engine/core/result.h"
#include "engine/io/cloud_io.h"
#include "server/ingest/decode_slots.h"
#include "server/ingest/png_reader.h"

namespace pointwright {

/// The first argument that makes a program a decoder: its main() returns decode_child_main() at once.
inline constexpr const char* kDecodeChildArgument = "--decode-child";

struct ConfineLimits {
  std::uint64_t memory_bytes = std::uint64_t{4}
                               << 30;      ///< address space of a decoder beyond what it starts with
  double deadline_seconds = 60.0;          ///< wall clock of one decoding; the processor's too, rounded up
  double queue_seconds = 60.0;             ///< how long to wait for a slot
  DecodeSlots* slots = nullptr;            ///< how many decoders run at once; null: as many as are asked for
  std::string program = "/proc/self/exe";  ///< what to start; its main() must know kDecodeChildArgument
};

/// decode_cloud() (engine/io/decoded_cloud.h) in a confined process.
/// Blocks up to queue_seconds + deadline_seconds. Safe from any thread; waits for no child but its own.
/// A build with a sanitizer bounds the child's time and descriptors only: sanitizers need the rest.
/// Errors: those of decode_cloud(); kTooLarge where memory, time or output ran out; kMalformedData where the
///         decoder died of the bytes; kCancelled where the context was cancelled, no slot came free in time,
///         or no process could be started (field "decoder": the server is to blame, not the file)
Result<ImportedCloud> decode_confined(std::span<const std::byte> bytes, CloudFormat format,
                                      const ImportParams& params, const ConfineLimits& limits,
                                      const ExecutionContext* context = nullptr);

/// The same for an open file of that many bytes, which the decoder reads by its descriptor: nothing is
/// copied. The file must not change meanwhile.
Result<ImportedCloud> decode_confined(int file, std::uint64_t byte_count, CloudFormat format,
                                      const ImportParams& params, const ConfineLimits& limits,
                                      const ExecutionContext* context = nullptr);

/// read_png() (png_reader.h) in a confined process, within the same limits and with the same further errors.
Result<Image> decode_image_confined(std::span<const std::byte> bytes, const ImageLimits& image_limits,
                                    const ConfineLimits& limits, const ExecutionContext* context = nullptr);

/// The decoder's side: main() returns this when argv[1] is kDecodeChildArgument. Never called otherwise.
int decode_child_main();

}  // namespace pointwright

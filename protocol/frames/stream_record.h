#pragma once
// The records of a session's stream: u32 type, u32 length, payload; all little-endian (FRAMES.md, "Streams").

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "engine/core/result.h"

namespace pointwright::protocol {

enum class StreamRecordType : std::uint32_t {
  kFrame = 1,  ///< a sample frame
  kEvent = 2,  ///< a JSON event in UTF-8
};

inline constexpr std::size_t kStreamRecordHeaderBytes = 8;

/// The eight bytes that stand before a payload. Pre: payload_bytes < 2^32.
std::array<std::byte, kStreamRecordHeaderBytes> stream_record_header(StreamRecordType type,
                                                                     std::size_t payload_bytes);

/// Header and payload appended to `out`: for small records; large payloads are sent after their header,
/// uncopied.
void append_stream_record(StreamRecordType type, std::span<const std::byte> payload,
                          std::vector<std::byte>& out);

struct StreamRecord {
  std::uint32_t type = 0;  ///< receivers skip the types that they do not know
  std::vector<std::byte> payload;
};

/// Puts records together again from chunks that are cut anywhere. Not thread-safe.
class StreamRecordParser {
 public:
  explicit StreamRecordParser(std::uint32_t max_payload_bytes = std::uint32_t{1} << 30)
      : max_payload_bytes_(max_payload_bytes) {}

  /// Takes more bytes of the stream. They are kept, at most one incomplete record of them beyond the next
  /// calls of next().
  void push(std::span<const std::byte> chunk);

  /// The next whole record; nothing while it is incomplete.
  /// Errors: kTooLarge for a payload beyond the limit, from its header on, and at every later call.
  Result<std::optional<StreamRecord>> next();

  /// Whether the stream may end here: no record is cut off.
  [[nodiscard]] bool at_record_end() const { return consumed_ == buffer_.size(); }

 private:
  std::uint32_t max_payload_bytes_;
  std::vector<std::byte> buffer_;
  std::size_t consumed_ = 0;
};

}  // namespace pointwright::protocol

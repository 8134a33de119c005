#include "protocol/frames/stream_record.h"

#include <limits>
#include <string>

#include "engine/core/check.h"
#include "protocol/frames/bytes.h"

namespace pointwright::protocol {

std::array<std::byte, kStreamRecordHeaderBytes> stream_record_header(StreamRecordType type,
                                                                     std::size_t payload_bytes) {
  POINTWRIGHT_CHECK(payload_bytes <= std::numeric_limits<std::uint32_t>::max(),
                    "a stream record beyond 4 GiB");
  std::array<std::byte, kStreamRecordHeaderBytes> header{};
  store(header.data(), static_cast<std::uint32_t>(type));
  store(header.data() + 4, static_cast<std::uint32_t>(payload_bytes));
  return header;
}

void append_stream_record(StreamRecordType type, std::span<const std::byte> payload,
                          std::vector<std::byte>& out) {
  const auto header = stream_record_header(type, payload.size());
  out.insert(out.end(), header.begin(), header.end());
  out.insert(out.end(), payload.begin(), payload.end());
}

void StreamRecordParser::push(std::span<const std::byte> chunk) {
  buffer_.erase(buffer_.begin(), buffer_.begin() + static_cast<std::ptrdiff_t>(consumed_));
  consumed_ = 0;
  buffer_.insert(buffer_.end(), chunk.begin(), chunk.end());
}

Result<std::optional<StreamRecord>> StreamRecordParser::next() {
  const std::span<const std::byte> rest = std::span<const std::byte>(buffer_).subspan(consumed_);
  if (rest.size() < kStreamRecordHeaderBytes) return std::optional<StreamRecord>{};
  const auto type = load<std::uint32_t>(rest, 0);
  const auto length = load<std::uint32_t>(rest, 4);
  if (length > max_payload_bytes_) {
    return Error{.code = ErrorCode::kTooLarge,
                 .message = "a stream record announces " + std::to_string(length) +
                            " bytes, beyond the limit of " + std::to_string(max_payload_bytes_),
                 .field = "length",
                 .limit = max_payload_bytes_,
                 .actual = length};
  }
  if (rest.size() - kStreamRecordHeaderBytes < length) return std::optional<StreamRecord>{};
  const auto payload = rest.subspan(kStreamRecordHeaderBytes, length);
  consumed_ += kStreamRecordHeaderBytes + length;
  return std::optional<StreamRecord>{StreamRecord{.type = type, .payload = {payload.begin(), payload.end()}}};
}

}  // namespace pointwright::protocol

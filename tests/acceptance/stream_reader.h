#pragma once
// A viewer's end of a session's stream.

#include <chrono>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>

#include "protocol/frames/frame.h"
#include "protocol/frames/stream_record.h"
#include "tests/acceptance/daemon.h"
#include "tests/server/raw_client.h"

namespace pointwright::test {

/// Reads a stream's records from a connection. Throws where the stream is not what it should be.
class StreamReader {
 public:
  StreamReader(const Daemon& daemon, const std::string& target) : client_(daemon.port()) {
    client_.send("GET " + target + " HTTP/1.1\r\nHost: localhost\r\n\r\n");
  }
  /// The next record within a while; nullopt at the end.
  std::optional<protocol::StreamRecord> next() {
    while (true) {
      auto record = parser_.next();
      if (!record.ok()) throw std::runtime_error(record.error().message);
      if (record.value()) return std::move(record).value();
      if (!client_.receive_some(raw_, std::chrono::seconds(20))) return std::nullopt;
      take_chunks();
    }
  }
  /// The next record of a frame, past events.
  std::optional<protocol::StreamRecord> next_frame_record() {
    auto record = next();
    while (record && record->type != static_cast<std::uint32_t>(protocol::StreamRecordType::kFrame))
      record = next();
    return record;
  }
  /// The next frame, past events.
  std::optional<protocol::DecodedFrame> next_frame() {
    const auto record = next_frame_record();
    if (!record) return std::nullopt;
    auto frame = protocol::decode_frame(record->payload);
    if (!frame.ok()) throw std::runtime_error(frame.error().message);
    return std::move(frame).value();
  }
  static nlohmann::json event(const protocol::StreamRecord& record) {
    const auto* begin = reinterpret_cast<const char*>(record.payload.data());
    return nlohmann::json::parse(begin, begin + record.payload.size());
  }
  void close() { client_.close(); }
  RawClient& client() { return client_; }

 private:
  void take_chunks() {
    if (!past_head_) {
      const std::size_t end = raw_.find("\r\n\r\n");
      if (end == std::string::npos) return;
      if (status_of(raw_) != 200) throw std::runtime_error("no stream: " + raw_);
      raw_.erase(0, end + 4);
      past_head_ = true;
    }
    while (true) {
      const std::size_t end = raw_.find("\r\n");
      if (end == std::string::npos) return;
      const std::size_t size = std::stoul(raw_.substr(0, end), nullptr, 16);
      if (raw_.size() < end + 2 + size + 2) return;
      parser_.push(std::as_bytes(std::span(raw_.data() + end + 2, size)));
      raw_.erase(0, end + 2 + size + 2);
    }
  }

  RawClient client_;
  protocol::StreamRecordParser parser_;
  std::string raw_;
  bool past_head_ = false;
};

}  // namespace pointwright::test

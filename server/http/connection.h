#pragma once
// One accepted socket with byte budgets and absolute deadlines. No HTTP library here.

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "server/base/descriptor.h"
#include "server/http/transport.h"

namespace pointwright::server {

using Clock = std::chrono::steady_clock;

class TlsIdentity;

/// Owns the descriptor; used by one thread at a time.
class Connection {
 public:
  /// Where there is an identity the bytes go through TLS; its handshake is within the deadline of the head.
  explicit Connection(int descriptor, const TlsIdentity* tls = nullptr);
  ~Connection() = default;
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  enum class HeadStatus { kComplete, kClosed, kTimedOut, kTooLarge };
  /// Reads up to and including the empty line that ends a head; bytes beyond it are kept for read_body.
  /// Never holds more than max_bytes (+ one read) and never waits beyond the deadline.
  HeadStatus read_head(std::size_t max_bytes, Clock::time_point deadline, std::string& head);

  /// How fast a body must come: any silence is at most the grace, and beyond it the bytes make the rate.
  struct BodyPace {
    std::chrono::milliseconds grace;
    std::uint64_t least_rate = 1;  ///< bytes a second
  };
  enum class BodyStatus { kComplete, kClosed, kTimedOut, kNoRoom };
  /// Reads exactly `length` bytes of body into `body` (reserved as it arrives, not as it is announced).
  /// `hold` is asked for room piece by piece, before the bytes are read; where it has none, reading ends.
  BodyStatus read_body(std::uint64_t length, BodyPace pace, const std::function<bool(std::uint64_t)>& hold,
                       std::string& body);

  /// The same, piece by piece to `take` instead of into memory; at most one piece of 256 KiB is held. Where
  /// `take` refuses one, reading ends with kNoRoom. `count`: the bytes that were taken.
  BodyStatus stream_body(std::uint64_t length, BodyPace pace,
                         const std::function<bool(std::span<const std::byte>)>& take, std::uint64_t& count);

  /// Writes everything before the deadline. False: the peer is gone or too slow; the connection is then
  /// broken.
  bool write_all(std::span<const std::byte> bytes, Clock::time_point deadline);
  bool write_all(std::string_view text, Clock::time_point deadline);
  /// The same for a few pieces in a row, uncopied.
  bool write_all(std::span<std::span<const std::byte>> pieces, Clock::time_point deadline);

  /// The address of the other side, without a port; empty where the system does not tell.
  [[nodiscard]] std::string peer_address() const;
  [[nodiscard]] bool is_broken() const { return broken_; }
  /// Whether the peer has closed or reset its side. Never blocks.
  [[nodiscard]] bool is_peer_gone() const;
  /// The same for the reader of a stream, also where bytes came before its end: what it sends is dropped, and
  /// who sends more than some KiB counts as gone. Never blocks.
  [[nodiscard]] bool is_reader_gone();

  /// Ends our side, then waits for the peer's end a little, dropping at most a bounded number of bytes: so
  /// that an answer that was sent before the body was read is not lost to a reset.
  void linger(std::chrono::milliseconds patience);

 private:
  /// recv within the deadline. > 0: bytes; 0: closed or broken; -1: timed out.
  std::ptrdiff_t receive(char* data, std::size_t size, Clock::time_point deadline);

  /// Waits for what a transport's attempt wants. False where it cannot go on: broken, ended or at the
  /// deadline.
  bool wait_for(Moved::Status status, Clock::time_point deadline) const;

  Descriptor descriptor_;
  std::unique_ptr<Transport> transport_;
  std::string pending_;      // read beyond the head, not yet handed out
  std::size_t unasked_ = 0;  // bytes that the reader of a stream sent
  bool broken_ = false;
};

}  // namespace pointwright::server

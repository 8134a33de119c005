#pragma once
// The bytes of one connection: as they are, or through TLS. Never blocks. No HTTP library here.

#include <cstddef>
#include <memory>
#include <span>

namespace pointwright::server {

/// What one attempt to move bytes came to.
struct Moved {
  enum class Status {
    kDone,       ///< `count` bytes, at least one
    kWantRead,   ///< again once the descriptor is readable
    kWantWrite,  ///< again once it is writable
    kEnded,      ///< the peer said that nothing more comes
    kBroken,     ///< nothing moves any more
  };
  Status status = Status::kBroken;
  std::size_t count = 0;
};

/// Works on a non-blocking descriptor that it does not own. Used by one thread at a time.
class Transport {
 public:
  Transport() = default;
  virtual ~Transport() = default;
  Transport(const Transport&) = delete;
  Transport& operator=(const Transport&) = delete;

  /// Pre: not empty.
  virtual Moved read(std::span<char> bytes) = 0;
  /// Some bytes of pieces in a row. After a wait the same pieces are to be offered again.
  /// Pre: the first is not empty.
  virtual Moved write(std::span<const std::span<const std::byte>> pieces) = 0;
  /// Tells the peer that nothing more comes from this side.
  virtual Moved end() = 0;
  /// Whether the peer has closed or reset its side.
  virtual bool is_peer_gone() = 0;
};

/// Bytes as they are.
std::unique_ptr<Transport> plain_transport(int descriptor);

}  // namespace pointwright::server

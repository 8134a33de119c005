#pragma once
// TLS for accepted sockets: the certificate and key in force, and the transport of a connection.

#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "server/http/transport.h"

struct ssl_ctx_st;

namespace pointwright::server {

/// TLS 1.2 and 1.3; no renegotiation, no compression, no kept sessions. Thread-safe.
class TlsIdentity {
 public:
  /// The files are read by reload() alone.
  TlsIdentity(std::string certificate_file, std::string key_file);

  /// Reads the chain of certificates and the key, both PEM in regular files and the key readable by its owner
  /// and group at most, for the connections that come from now on. Never waits for a pipe. Where that fails,
  /// or the certificate has expired and the one in force has not, a sentence says so, and what was in force
  /// stays.
  std::optional<std::string> reload();

  /// Until when the certificate in force is valid, as "Nov 23 03:27:15 2026 GMT"; empty before the first one.
  [[nodiscard]] std::string valid_until() const;
  /// Whether the certificate in force is past that.
  [[nodiscard]] bool has_expired() const;

  /// The transport of an accepted socket. The handshake happens within its first reads. A peer that speaks
  /// HTTP without TLS is told so, and its connection ended. Throws where there is no memory.
  [[nodiscard]] std::unique_ptr<Transport> accept(int descriptor) const;

 private:
  std::string certificate_file_;
  std::string key_file_;
  mutable std::mutex mutex_;
  std::shared_ptr<ssl_ctx_st> context_;  // guarded by mutex_; replaced as a whole
};

}  // namespace pointwright::server

#include "server/http/tls.h"

#include <openssl/bio.h>
#include <openssl/err.h>
#include <openssl/ssl.h>
#include <openssl/x509.h>
#include <sys/socket.h>
#include <sys/types.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdint>
#include <new>
#include <span>
#include <string_view>
#include <system_error>
#include <utility>

namespace pointwright::server {
namespace {

constexpr std::size_t kRecordBytes = SSL3_RT_MAX_PLAIN_LENGTH;

/// What a client without TLS is told: the shortest answer that names the mistake.
constexpr std::string_view kSpeakTls =
    "HTTP/1.1 400 Bad Request\r\nContent-Type: text/plain\r\nContent-Length: 39\r\nConnection: close\r\n\r\n"
    "This port speaks TLS: ask by https://.\n";

int socket_of(BIO* bio) {
  return static_cast<int>(reinterpret_cast<std::intptr_t>(BIO_get_data(bio)));
}

bool must_wait() {
  return errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR;
}

// OpenSSL's own BIO of sockets writes without MSG_NOSIGNAL.
int write_socket(BIO* bio, const char* data, int size) {
  BIO_clear_retry_flags(bio);
  const ssize_t count = ::send(socket_of(bio), data, static_cast<std::size_t>(size), MSG_NOSIGNAL);
  if (count < 0 && must_wait()) BIO_set_retry_write(bio);
  return static_cast<int>(count);
}

int read_socket(BIO* bio, char* data, int size) {
  BIO_clear_retry_flags(bio);
  const ssize_t count = ::recv(socket_of(bio), data, static_cast<std::size_t>(size), 0);
  if (count < 0 && must_wait()) BIO_set_retry_read(bio);
  if (count == 0) BIO_set_flags(bio, BIO_FLAGS_IN_EOF);
  return static_cast<int>(count);
}

long control_socket(BIO* bio, int command, long, void*) {
  if (command == BIO_CTRL_EOF) return BIO_test_flags(bio, BIO_FLAGS_IN_EOF) != 0 ? 1 : 0;
  return command == BIO_CTRL_FLUSH ? 1 : 0;
}

BIO_METHOD* socket_method() {
  static BIO_METHOD* const method = [] {
    BIO_METHOD* const made = BIO_meth_new(BIO_get_new_index() | BIO_TYPE_SOURCE_SINK, "socket");
    if (made == nullptr) throw std::bad_alloc();
    BIO_meth_set_write(made, write_socket);
    BIO_meth_set_read(made, read_socket);
    BIO_meth_set_ctrl(made, control_socket);
    return made;
  }();
  return method;
}

struct SslDeleter {
  void operator()(SSL* ssl) const { SSL_free(ssl); }
};
using OwnSsl = std::unique_ptr<SSL, SslDeleter>;

class TlsTransport final : public Transport {
 public:
  TlsTransport(int descriptor, OwnSsl ssl)
      : plain_(plain_transport(descriptor)), descriptor_(descriptor), ssl_(std::move(ssl)) {}

  Moved read(std::span<char> bytes) override {
    if (state_ == State::kPlain) return plain_->read(bytes);
    if (state_ == State::kNew) {
      char first = 0;
      const ssize_t count = ::recv(descriptor_, &first, 1, MSG_PEEK);
      if (count < 0) return {.status = must_wait() ? Moved::Status::kWantRead : Moved::Status::kBroken};
      if (count == 0) return {.status = Moved::Status::kEnded};
      if (first >= 'A' && first <= 'Z') return refuse_plain();
      state_ = State::kTls;
    }
    if (state_ == State::kFailed) return {};
    ERR_clear_error();
    std::size_t count = 0;
    const int done = SSL_read_ex(ssl_.get(), bytes.data(), bytes.size(), &count);
    return judged(done, count);
  }

  Moved write(std::span<const std::span<const std::byte>> pieces) override {
    if (state_ != State::kTls) return {};
    std::span<const std::byte> next = pieces.front();
    // Small pieces share a record, which is all that is copied; large ones are encrypted from where they are.
    std::array<std::byte, kRecordBytes> record;
    if (pieces.size() > 1 && next.size() < record.size()) {
      std::size_t size = 0;
      for (const std::span<const std::byte> piece : pieces) {
        const std::size_t part = std::min(piece.size(), record.size() - size);
        std::copy_n(piece.begin(), part, record.begin() + static_cast<std::ptrdiff_t>(size));
        size += part;
      }
      next = std::span(record).first(size);
    }
    ERR_clear_error();
    std::size_t count = 0;
    const int done = SSL_write_ex(ssl_.get(), next.data(), next.size(), &count);
    return judged(done, count);
  }

  Moved end() override {
    if (state_ == State::kTls && SSL_is_init_finished(ssl_.get()) == 1) {
      ERR_clear_error();
      const int done = SSL_shutdown(ssl_.get());
      if (done < 0) {
        const Moved moved = judged(done, 0);
        if (moved.status == Moved::Status::kWantWrite) return moved;
      }
    }
    return plain_->end();
  }

  bool is_peer_gone() override {
    if (state_ == State::kFailed) return true;
    if (state_ == State::kTls) {
      // Records that arrived may hold the peer's end, which the socket does not tell.
      char next = 0;
      std::size_t count = 0;
      ERR_clear_error();
      const int done = SSL_peek_ex(ssl_.get(), &next, 1, &count);
      const Moved moved = judged(done, count);
      if (moved.status == Moved::Status::kEnded || moved.status == Moved::Status::kBroken) return true;
    }
    return plain_->is_peer_gone();
  }

 private:
  enum class State { kNew, kTls, kPlain, kFailed };

  /// Answers a request that came without TLS; what else it sends is dropped by the lingering connection.
  Moved refuse_plain() {
    state_ = State::kPlain;
    // A new socket's buffer takes it whole.
    (void)::send(descriptor_, kSpeakTls.data(), kSpeakTls.size(), MSG_NOSIGNAL);
    return {.status = Moved::Status::kEnded};
  }

  Moved judged(int done, std::size_t count) {
    if (done == 1) return {.status = Moved::Status::kDone, .count = count};
    switch (SSL_get_error(ssl_.get(), done)) {
      case SSL_ERROR_WANT_READ:
        return {.status = Moved::Status::kWantRead};
      case SSL_ERROR_WANT_WRITE:
        return {.status = Moved::Status::kWantWrite};
      case SSL_ERROR_ZERO_RETURN:
        return {.status = Moved::Status::kEnded};
      default:
        state_ = State::kFailed;  // after which OpenSSL takes no further calls
        return {.status = Moved::Status::kBroken};
    }
  }

  std::unique_ptr<Transport> plain_;
  int descriptor_;
  OwnSsl ssl_;
  State state_ = State::kNew;
};

/// Why the last call failed, without what was in the file.
std::string reason() {
  const char* text = nullptr;
  // What the system says comes first, and is the cause of what follows.
  while (const unsigned long error = ERR_get_error()) {
    if (ERR_SYSTEM_ERROR(error) != 0) return std::generic_category().message(ERR_GET_REASON(error));
    text = ERR_reason_error_string(error);
  }
  return text == nullptr ? "it cannot be read" : text;
}

/// Nobody is asked for a passphrase: there is no terminal.
int no_passphrase(char*, int, int, void*) {
  return -1;
}

/// Of the protocols that the client offers there is one that we speak.
int choose_http(SSL*, const unsigned char** chosen, unsigned char* chosen_size, const unsigned char* offered,
                unsigned int offered_size, void*) {
  static constexpr std::array<unsigned char, 9> kHttp = {8, 'h', 't', 't', 'p', '/', '1', '.', '1'};
  unsigned char* found = nullptr;
  const int done =
      SSL_select_next_proto(&found, chosen_size, kHttp.data(), kHttp.size(), offered, offered_size);
  *chosen = found;
  return done == OPENSSL_NPN_NEGOTIATED ? SSL_TLSEXT_ERR_OK : SSL_TLSEXT_ERR_ALERT_FATAL;
}

std::shared_ptr<SSL_CTX> new_context() {
  std::shared_ptr<SSL_CTX> context(SSL_CTX_new(TLS_server_method()), SSL_CTX_free);
  if (context == nullptr) throw std::bad_alloc();
  SSL_CTX* const raw = context.get();
  SSL_CTX_set_min_proto_version(raw, TLS1_2_VERSION);
  SSL_CTX_set_options(raw, SSL_OP_NO_RENEGOTIATION | SSL_OP_NO_COMPRESSION | SSL_OP_NO_TICKET |
                               SSL_OP_CIPHER_SERVER_PREFERENCE | SSL_OP_IGNORE_UNEXPECTED_EOF);
  SSL_CTX_set_cipher_list(raw, "ECDHE+AESGCM:ECDHE+CHACHA20");
  SSL_CTX_set_session_cache_mode(raw, SSL_SESS_CACHE_OFF);
  SSL_CTX_set_num_tickets(raw, 0);
  SSL_CTX_set_mode(
      raw, SSL_MODE_ENABLE_PARTIAL_WRITE | SSL_MODE_ACCEPT_MOVING_WRITE_BUFFER | SSL_MODE_RELEASE_BUFFERS);
  SSL_CTX_set_default_passwd_cb(raw, no_passphrase);
  SSL_CTX_set_alpn_select_cb(raw, choose_http, nullptr);
  return context;
}

}  // namespace

TlsIdentity::TlsIdentity(std::string certificate_file, std::string key_file)
    : certificate_file_(std::move(certificate_file)), key_file_(std::move(key_file)) {}

std::optional<std::string> TlsIdentity::reload() {
  const std::shared_ptr<SSL_CTX> context = new_context();
  ERR_clear_error();
  if (SSL_CTX_use_certificate_chain_file(context.get(), certificate_file_.c_str()) != 1)
    return "tls_cert: " + certificate_file_ + ": " + reason();
  const bool is_read = SSL_CTX_use_PrivateKey_file(context.get(), key_file_.c_str(), SSL_FILETYPE_PEM) == 1;
  if (is_read ? SSL_CTX_check_private_key(context.get()) != 1
              : ERR_GET_REASON(ERR_peek_last_error()) == X509_R_KEY_VALUES_MISMATCH)
    return "tls_key: " + key_file_ + ": not the key of the certificate " + certificate_file_;
  if (!is_read) return "tls_key: " + key_file_ + ": " + reason();
  const std::lock_guard lock(mutex_);
  context_ = context;
  return std::nullopt;
}

std::string TlsIdentity::valid_until() const {
  const std::lock_guard lock(mutex_);
  if (context_ == nullptr) return {};
  const std::unique_ptr<BIO, int (*)(BIO*)> text(BIO_new(BIO_s_mem()), BIO_free);
  if (text == nullptr) return {};
  ASN1_TIME_print(text.get(), X509_get0_notAfter(SSL_CTX_get0_certificate(context_.get())));
  char* bytes = nullptr;
  const long size = BIO_get_mem_data(text.get(), &bytes);
  return {bytes, static_cast<std::size_t>(size)};
}

std::unique_ptr<Transport> TlsIdentity::accept(int descriptor) const {
  std::shared_ptr<SSL_CTX> context;
  {
    const std::lock_guard lock(mutex_);
    context = context_;
  }
  OwnSsl ssl(context == nullptr ? nullptr : SSL_new(context.get()));
  BIO* const bio = ssl == nullptr ? nullptr : BIO_new(socket_method());
  if (bio == nullptr) throw std::bad_alloc();
  BIO_set_data(bio, reinterpret_cast<void*>(static_cast<std::intptr_t>(descriptor)));  // NOLINT
  BIO_set_init(bio, 1);
  SSL_set_bio(ssl.get(), bio, bio);
  SSL_set_accept_state(ssl.get());
  return std::make_unique<TlsTransport>(descriptor, std::move(ssl));
}

}  // namespace pointwright::server

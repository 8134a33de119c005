#include "server/http/tls.h"

#include <fcntl.h>
#include <openssl/bio.h>
#include <openssl/crypto.h>
#include <openssl/err.h>
#include <openssl/evp.h>
#include <openssl/pem.h>
#include <openssl/ssl.h>
#include <openssl/x509.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/types.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdint>
#include <new>
#include <span>
#include <string_view>
#include <system_error>
#include <utility>

#include "server/base/descriptor.h"

namespace pointwright::server {
namespace {

constexpr std::size_t kRecordBytes = SSL3_RT_MAX_PLAIN_LENGTH;

/// Far more than a chain of certificates has.
constexpr std::uint64_t kMostPemBytes = 1U << 20U;

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
  while (const unsigned long error = ERR_get_error()) text = ERR_reason_error_string(error);
  return text == nullptr ? "TLS cannot take it" : text;
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

/// The text of a file of certificates or of a key; cleared at its end.
struct PemText {
  PemText() = default;
  PemText(const PemText&) = delete;
  PemText& operator=(const PemText&) = delete;
  ~PemText() { OPENSSL_cleanse(bytes.data(), bytes.size()); }
  std::string bytes;
};

/// Reads a whole regular file. A pipe or a device must not hold who reloads: that thread also ends the
/// daemon.
/// Where it does not serve a sentence says why.
std::optional<std::string> read_pem(const std::string& path, bool is_key, PemText& text) {
  const Descriptor file(::open(path.c_str(), O_RDONLY | O_NONBLOCK | O_NOCTTY | O_CLOEXEC));
  struct stat info {};
  if (!file.is_open() || ::fstat(file.get(), &info) != 0) return std::generic_category().message(errno);
  if (!S_ISREG(info.st_mode)) return "is not a regular file";
  // A group of those who may read keys is what Debian has in ssl-cert.
  if (is_key && (info.st_mode & (S_IRWXO | S_IWGRP)) != 0)
    return "others than its owner and group may use the key, or the group may change it; its mode must be "
           "0600 or 0640";
  const auto size = static_cast<std::uint64_t>(info.st_size);
  if (size > kMostPemBytes) return "is larger than " + std::to_string(kMostPemBytes) + " bytes";
  text.bytes.resize(static_cast<std::size_t>(size));
  std::size_t at = 0;
  while (at < text.bytes.size()) {
    const ssize_t count = ::read(file.get(), text.bytes.data() + at, text.bytes.size() - at);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) return std::generic_category().message(errno);
    if (count == 0) break;  // cut short under our hands
    at += static_cast<std::size_t>(count);
  }
  text.bytes.resize(at);
  return std::nullopt;
}

using OwnBio = std::unique_ptr<BIO, int (*)(BIO*)>;
using OwnCertificate = std::unique_ptr<X509, void (*)(X509*)>;
using OwnKey = std::unique_ptr<EVP_PKEY, void (*)(EVP_PKEY*)>;

OwnBio reader_of(const PemText& text) {
  OwnBio bio(BIO_new_mem_buf(text.bytes.data(), static_cast<int>(text.bytes.size())), BIO_free);
  if (bio == nullptr) throw std::bad_alloc();
  ERR_clear_error();
  return bio;
}

/// The server's certificate, then those between it and its authority.
std::optional<std::string> use_chain(SSL_CTX* context, const std::string& path) {
  PemText text;
  if (auto problem = read_pem(path, false, text)) return problem;
  const OwnBio bio = reader_of(text);
  const OwnCertificate own(PEM_read_bio_X509_AUX(bio.get(), nullptr, no_passphrase, nullptr), X509_free);
  if (own == nullptr) return "is not a PEM certificate";
  if (SSL_CTX_use_certificate(context, own.get()) != 1) return reason();
  while (true) {
    OwnCertificate next(PEM_read_bio_X509(bio.get(), nullptr, no_passphrase, nullptr), X509_free);
    if (next == nullptr) break;
    if (SSL_CTX_add0_chain_cert(context, next.get()) != 1) return reason();
    (void)next.release();  // the context has it now
  }
  const bool is_end = ERR_GET_REASON(ERR_peek_last_error()) == PEM_R_NO_START_LINE;
  ERR_clear_error();
  if (!is_end) return "is not a PEM certificate throughout";
  return std::nullopt;
}

std::optional<std::string> use_key(SSL_CTX* context, const std::string& path,
                                   const std::string& certificate_path) {
  PemText text;
  if (auto problem = read_pem(path, true, text)) return problem;
  const OwnBio bio = reader_of(text);
  const OwnKey key(PEM_read_bio_PrivateKey(bio.get(), nullptr, no_passphrase, nullptr), EVP_PKEY_free);
  if (key == nullptr) return "is not a PEM key without a passphrase";
  if (X509_check_private_key(SSL_CTX_get0_certificate(context), key.get()) != 1)
    return "not the key of the certificate " + certificate_path;
  if (SSL_CTX_use_PrivateKey(context, key.get()) != 1) return reason();
  return std::nullopt;
}

bool is_expired(const SSL_CTX* context) {
  return X509_cmp_current_time(X509_get0_notAfter(SSL_CTX_get0_certificate(context))) < 0;
}

std::string end_of(const SSL_CTX* context) {
  const OwnBio text(BIO_new(BIO_s_mem()), BIO_free);
  if (text == nullptr) return {};
  ASN1_TIME_print(text.get(), X509_get0_notAfter(SSL_CTX_get0_certificate(context)));
  char* bytes = nullptr;
  const long size = BIO_get_mem_data(text.get(), &bytes);
  return {bytes, static_cast<std::size_t>(size)};
}

}  // namespace

TlsIdentity::TlsIdentity(std::string certificate_file, std::string key_file)
    : certificate_file_(std::move(certificate_file)), key_file_(std::move(key_file)) {}

std::optional<std::string> TlsIdentity::reload() {
  const std::shared_ptr<SSL_CTX> context = new_context();
  if (auto problem = use_chain(context.get(), certificate_file_))
    return "tls_cert: " + certificate_file_ + ": " + *problem;
  if (auto problem = use_key(context.get(), key_file_, certificate_file_))
    return "tls_key: " + key_file_ + ": " + *problem;
  const std::lock_guard lock(mutex_);
  if (context_ != nullptr && is_expired(context.get()) && !is_expired(context_.get()))
    return "tls_cert: " + certificate_file_ + ": has expired: " + end_of(context.get());
  context_ = context;
  return std::nullopt;
}

std::string TlsIdentity::valid_until() const {
  const std::lock_guard lock(mutex_);
  return context_ == nullptr ? std::string() : end_of(context_.get());
}

bool TlsIdentity::has_expired() const {
  const std::lock_guard lock(mutex_);
  return context_ != nullptr && is_expired(context_.get());
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

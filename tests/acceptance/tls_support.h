#pragma once
// A certificate of the test's own, and a client that speaks TLS.

#include <openssl/err.h>
#include <openssl/pem.h>
#include <openssl/ssl.h>
#include <openssl/x509v3.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <stdexcept>
#include <string>
#include <string_view>

#include "tests/server/raw_client.h"

namespace pointwright::test {

template <typename T, void (*free_it)(T*)>
struct OpenSslDeleter {
  void operator()(T* owned) const { free_it(owned); }
};
using OwnKey = std::unique_ptr<EVP_PKEY, OpenSslDeleter<EVP_PKEY, EVP_PKEY_free>>;
using OwnCertificate = std::unique_ptr<X509, OpenSslDeleter<X509, X509_free>>;
using OwnContext = std::unique_ptr<SSL_CTX, OpenSslDeleter<SSL_CTX, SSL_CTX_free>>;
using OwnSsl = std::unique_ptr<SSL, OpenSslDeleter<SSL, SSL_free>>;

/// Writes a new key, readable by its owner alone, and a certificate signed by it, for the names.
inline void write_certificate(const std::string& certificate_file, const std::string& key_file,
                              const char* names = "DNS:localhost,DNS:pointwright.test,IP:127.0.0.1",
                              long valid_seconds = 86'400) {
  const OwnKey key(EVP_EC_gen("P-256"));
  const OwnCertificate certificate(X509_new());
  X509* const made = certificate.get();
  X509_set_version(made, 2);
  ASN1_INTEGER_set(X509_get_serialNumber(made), 1);
  X509_gmtime_adj(X509_getm_notBefore(made), std::min(valid_seconds, 0L) - 60);
  X509_gmtime_adj(X509_getm_notAfter(made), valid_seconds);
  X509_set_pubkey(made, key.get());
  X509_NAME* const name = X509_get_subject_name(made);
  const auto* common = reinterpret_cast<const unsigned char*>("pointwright.test");
  X509_NAME_add_entry_by_txt(name, "CN", MBSTRING_ASC, common, -1, -1, 0);
  X509_set_issuer_name(made, name);
  const auto extend = [&](int what, const char* text) {
    X509V3_CTX context;
    X509V3_set_ctx_nodb(&context);
    X509V3_set_ctx(&context, made, made, nullptr, nullptr, 0);
    X509_EXTENSION* const extension = X509V3_EXT_conf_nid(nullptr, &context, what, text);
    X509_add_ext(made, extension, -1);
    X509_EXTENSION_free(extension);
  };
  extend(NID_basic_constraints, "critical,CA:TRUE");
  extend(NID_subject_alt_name, names);
  if (X509_sign(made, key.get(), EVP_sha256()) == 0) throw std::runtime_error("cannot sign a certificate");
  const auto write = [](const std::string& path, const auto& put) {
    const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(std::fopen(path.c_str(), "wb"), std::fclose);
    if (file == nullptr || put(file.get()) != 1) throw std::runtime_error("cannot write " + path);
  };
  write(certificate_file, [&](std::FILE* file) { return PEM_write_X509(file, made); });
  write(key_file, [&](std::FILE* file) {
    return PEM_write_PrivateKey(file, key.get(), nullptr, nullptr, 0, nullptr, nullptr);
  });
  std::filesystem::permissions(key_file,
                               std::filesystem::perms::owner_read | std::filesystem::perms::owner_write);
}

/// Verifies the server's certificate by `ca` and its name as localhost. Throws where there is no TLS.
class TlsClient {
 public:
  TlsClient(std::uint16_t port, const std::string& ca, int least = TLS1_2_VERSION, int most = TLS1_3_VERSION)
      : socket_(port), context_(SSL_CTX_new(TLS_client_method())) {
    SSL_CTX_set_min_proto_version(context_.get(), least);
    SSL_CTX_set_max_proto_version(context_.get(), most);
    // Old versions of TLS too: what is tested is that the server refuses them.
    if (least < TLS1_2_VERSION) SSL_CTX_set_cipher_list(context_.get(), "ALL:@SECLEVEL=0");
    SSL_CTX_load_verify_locations(context_.get(), ca.c_str(), nullptr);
    SSL_CTX_set_verify(context_.get(), SSL_VERIFY_PEER, nullptr);
    ssl_.reset(SSL_new(context_.get()));
    SSL_set1_host(ssl_.get(), "localhost");
    SSL_set_tlsext_host_name(ssl_.get(), "localhost");
    SSL_set_fd(ssl_.get(), socket_.descriptor());
    ERR_clear_error();
    if (SSL_connect(ssl_.get()) != 1) throw std::runtime_error("no TLS");
  }

  [[nodiscard]] RawClient& socket() { return socket_; }
  [[nodiscard]] SSL* ssl() { return ssl_.get(); }

  bool send(std::string_view bytes) {
    while (!bytes.empty()) {
      std::size_t count = 0;
      if (SSL_write_ex(ssl_.get(), bytes.data(), bytes.size(), &count) != 1) return false;
      bytes.remove_prefix(count);
    }
    return true;
  }

  /// One more piece; false at the end or after `patience`.
  bool receive_some(std::string& text, std::chrono::milliseconds patience = std::chrono::seconds(20)) {
    pollfd entry{.fd = socket_.descriptor(), .events = POLLIN, .revents = 0};
    if (SSL_has_pending(ssl_.get()) == 0 && ::poll(&entry, 1, static_cast<int>(patience.count())) <= 0)
      return false;
    std::string piece(65'536, '\0');
    std::size_t count = 0;
    if (SSL_read_ex(ssl_.get(), piece.data(), piece.size(), &count) != 1) {
      ended_well_ = (SSL_get_shutdown(ssl_.get()) & SSL_RECEIVED_SHUTDOWN) != 0;
      return false;
    }
    text.append(piece, 0, count);
    return true;
  }
  std::string receive_all() {
    std::string text;
    while (receive_some(text)) {
    }
    return text;
  }
  /// Whether the server said that nothing more comes (close_notify).
  [[nodiscard]] bool ended_well() const { return ended_well_; }

 private:
  RawClient socket_;
  OwnContext context_;
  OwnSsl ssl_;
  bool ended_well_ = false;
};

}  // namespace pointwright::test

#include "server/access/secret.h"

#include <openssl/crypto.h>

#include <span>

#include "server/base/random_id.h"
#include "server/base/sha256.h"

namespace pointwright::server {

std::string new_secret(std::string_view prefix) {
  constexpr std::size_t kSecretBytes = 32;
  return std::string(prefix).append(random_text(kSecretBytes));
}

std::string digest_of(std::string_view secret) {
  return sha256_hex(std::as_bytes(std::span(secret.data(), secret.size())));
}

bool same_digest(std::string_view a, std::string_view b) {
  return a.size() == b.size() && CRYPTO_memcmp(a.data(), b.data(), a.size()) == 0;
}

}  // namespace pointwright::server

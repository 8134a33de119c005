#include "server/base/sha256.h"

#include <openssl/evp.h>

#include <array>
#include <stdexcept>
#include <string_view>

namespace pointwright::server {
namespace {

void require(int result) {
  if (result != 1) throw std::runtime_error("the digest is not available");
}

}  // namespace

struct Digest::State {
  std::unique_ptr<EVP_MD_CTX, void (*)(EVP_MD_CTX*)> context{EVP_MD_CTX_new(), EVP_MD_CTX_free};
};

Digest::Digest(Algorithm algorithm) : state_(std::make_unique<State>()) {
  const EVP_MD* const kind = algorithm == Algorithm::kSha1 ? EVP_sha1() : EVP_sha256();
  require(EVP_DigestInit_ex(state_->context.get(), kind, nullptr));
}
Digest::~Digest() = default;
Digest::Digest(Digest&&) noexcept = default;
Digest& Digest::operator=(Digest&&) noexcept = default;

void Digest::add(std::span<const std::byte> bytes) {
  require(EVP_DigestUpdate(state_->context.get(), bytes.data(), bytes.size()));
}

std::string Digest::finish() {
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
  unsigned size = 0;
  require(EVP_DigestFinal_ex(state_->context.get(), digest.data(), &size));
  return {reinterpret_cast<const char*>(digest.data()), size};
}

std::string to_hex(const std::string& digest) {
  constexpr std::string_view kDigits = "0123456789abcdef";
  std::string text;
  for (const char c : digest) {
    const auto byte = static_cast<unsigned char>(c);
    text.push_back(kDigits[byte >> 4U]);
    text.push_back(kDigits[byte & 15U]);
  }
  return text;
}

std::string sha256_hex(std::span<const std::byte> bytes) {
  Digest digest(Digest::Algorithm::kSha256);
  digest.add(bytes);
  return to_hex(digest.finish());
}

}  // namespace pointwright::server

#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <string>

namespace pointwright::server {

/// A digest of bytes that come piece by piece. Throws std::runtime_error where the library has none.
class Digest {
 public:
  enum class Algorithm { kSha1, kSha256 };
  explicit Digest(Algorithm algorithm);
  ~Digest();
  Digest(Digest&&) noexcept;
  Digest& operator=(Digest&&) noexcept;
  void add(std::span<const std::byte> bytes);
  /// The digest's bytes. Ends it.
  std::string finish();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// As hexadecimal digits.
std::string to_hex(const std::string& digest);

/// The SHA-256 of the bytes, as 64 hexadecimal digits.
std::string sha256_hex(std::span<const std::byte> bytes);

}  // namespace pointwright::server

#pragma once
// Secrets that callers carry: 256 random bits as text. What is kept of them is their SHA-256.

#include <string>
#include <string_view>

namespace pointwright::server {

inline constexpr std::string_view kTokenPrefix = "pw_";   ///< of tokens
inline constexpr std::string_view kSharePrefix = "pws_";  ///< of the capabilities of share links

/// The prefix and 43 characters of base64url: 256 bits from the kernel.
std::string new_secret(std::string_view prefix);

/// The SHA-256 of a secret, in hexadecimal.
std::string digest_of(std::string_view secret);

/// Compares two digests in a time that does not tell where they differ.
bool same_digest(std::string_view a, std::string_view b);

}  // namespace pointwright::server

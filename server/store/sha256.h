#pragma once

#include <cstddef>
#include <span>
#include <string>

namespace pointwright::server {

/// The SHA-256 of the bytes, as 64 hexadecimal digits.
std::string sha256_hex(std::span<const std::byte> bytes);

}  // namespace pointwright::server

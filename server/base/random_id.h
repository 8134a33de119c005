#pragma once

#include <cstddef>
#include <string>

namespace pointwright::server {

/// 22 characters of base64url, the first no dash: nearly 128 bits from the kernel. Throws std::runtime_error
/// where it gives none.
std::string random_id();

/// As many random bytes in base64url, without padding.
std::string random_text(std::size_t bytes);

}  // namespace pointwright::server

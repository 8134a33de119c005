#pragma once

#include <string>

namespace pointwright::server {

/// 22 characters of base64url: 128 bits from the kernel. Throws std::runtime_error where it gives none.
std::string random_id();

}  // namespace pointwright::server

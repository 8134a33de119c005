#pragma once
// Debian ships the HTTP library compiled. Another version, or other macros than its own (they come with the
// pkg-config target), would change the layout of its classes under our feet.

#include <httplib.h>

#include <string_view>

static_assert(std::string_view(CPPHTTPLIB_VERSION) == "0.11.4",
              "the fence is written against cpp-httplib 0.11.4");
#if !defined(CPPHTTPLIB_OPENSSL_SUPPORT) || !defined(CPPHTTPLIB_ZLIB_SUPPORT) || \
    !defined(CPPHTTPLIB_BROTLI_SUPPORT)
#error "compile with the flags of cpp-httplib.pc: Debian's library is built with them"
#endif

#pragma once
// What a decoder gives up before it looks at a foreign byte.

#include <cstdint>

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define POINTWRIGHT_SANITIZED_BUILD 1
#elif defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer) || __has_feature(memory_sanitizer)
#define POINTWRIGHT_SANITIZED_BUILD 1
#endif
#endif

namespace pointwright {

/// Built with a sanitizer whose run-time library needs more than a sandbox leaves.
#ifdef POINTWRIGHT_SANITIZED_BUILD
inline constexpr bool kSanitizedBuild = true;
#else
inline constexpr bool kSanitizedBuild = false;
#endif

/// Bytes of address space that this process has now.
std::uint64_t address_space_bytes();

/// Address space from here on: at most `extra` bytes beyond what there is. Never raises an earlier bound.
/// Does nothing in builds with an address or thread sanitizer, which reserve terabytes.
bool limit_address_space(std::uint64_t base, std::uint64_t extra);

/// Processor seconds, bytes written to files, core dumps (none) and processes (none); death with the parent.
bool limit_resources(std::uint64_t cpu_seconds, std::uint64_t output_bytes);

/// No new privileges, and a filter that kills the process on every system call but those that computing,
/// reading and writing open descriptors, memory and leaving need. Memory can never be made executable. Builds
/// with a sanitizer go without the filter: their run-time libraries need more.
bool forbid_system_calls();

}  // namespace pointwright

// The format of Marc Lehmann's LibLZF, from its description: a control byte below 32 is followed by that many
// literal bytes and one; any other repeats what stands up to 8 KiB before.
#include "engine/io/lzf.h"

#include <cstring>
#include <string>

namespace pointwright {
namespace {

Error malformed(std::size_t at, const char* what) {
  std::string message = "the compressed data is damaged at byte " + std::to_string(at);
  message.append(": ").append(what);
  return Error{.code = ErrorCode::kMalformedData, .message = std::move(message), .field = {}};
}

}  // namespace

Result<void> expand_lzf(std::span<const std::byte> from, std::span<std::byte> to) {
  std::size_t in = 0;
  std::size_t out = 0;
  while (in < from.size()) {
    const std::size_t start = in;
    const auto control = std::to_integer<std::size_t>(from[in++]);
    if (control < 32) {
      const std::size_t length = control + 1;
      if (length > from.size() - in) return malformed(start, "it ends within literal bytes");
      if (length > to.size() - out) return malformed(start, "it is longer than declared");
      std::memcpy(to.data() + out, from.data() + in, length);
      in += length;
      out += length;
      continue;
    }
    std::size_t length = control >> 5U;
    const bool is_long = length == 7;
    if (from.size() - in < (is_long ? 2U : 1U)) return malformed(start, "it ends within a reference");
    if (is_long) length += std::to_integer<std::size_t>(from[in++]);
    length += 2;
    const std::size_t back = ((control & 31U) << 8U) + std::to_integer<std::size_t>(from[in++]) + 1;
    if (back > out) return malformed(start, "a reference lies before the data");
    if (length > to.size() - out) return malformed(start, "it is longer than declared");
    // Byte by byte: the two may overlap, which repeats a pattern.
    for (std::size_t i = 0; i < length; ++i, ++out) to[out] = to[out - back];
  }
  if (out != to.size()) return malformed(in, "it is shorter than declared");
  return {};
}

}  // namespace pointwright

#include "server/store/marks_code.h"

#include <cstring>

namespace pointwright::server {
namespace {

/// The end of the run that starts at `begin`. Eight marks at a time: most runs are long.
std::size_t end_of_run(const Marks& marks, std::size_t begin) {
  const std::uint8_t mark = marks[begin];
  std::size_t end = begin + 1;
  const std::uint64_t same = 0x0101010101010101ULL * mark;
  while (end + 8 <= marks.size()) {
    std::uint64_t eight = 0;
    std::memcpy(&eight, marks.data() + end, 8);
    if (eight != same) break;
    end += 8;
  }
  while (end < marks.size() && marks[end] == mark) ++end;
  return end;
}

}  // namespace

std::vector<std::byte> encode_marks(const Marks& marks) {
  std::vector<std::byte> bytes;
  for (std::size_t begin = 0; begin < marks.size();) {
    const std::size_t end = end_of_run(marks, begin);
    std::uint64_t value = static_cast<std::uint64_t>(end - begin) << 2U | (marks[begin] & 3U);
    for (; value >= 128; value >>= 7U) bytes.push_back(static_cast<std::byte>(128U | (value & 127U)));
    bytes.push_back(static_cast<std::byte>(value));
    begin = end;
  }
  return bytes;
}

std::optional<Marks> decode_marks(std::span<const std::byte> bytes, std::uint64_t most) {
  Marks marks;
  while (!bytes.empty()) {
    std::uint64_t value = 0;
    unsigned shift = 0;
    bool goes_on = true;
    while (goes_on) {
      if (bytes.empty() || shift > 35) return std::nullopt;
      const auto byte = static_cast<std::uint64_t>(bytes.front());
      bytes = bytes.subspan(1);
      value |= (byte & 127U) << shift;
      shift += 7;
      goes_on = byte >= 128;
    }
    const std::uint64_t length = value >> 2U;
    if (length == 0 || length > most - marks.size()) return std::nullopt;
    marks.insert(marks.end(), static_cast<std::size_t>(length), static_cast<std::uint8_t>(value & 3U));
  }
  return marks;
}

}  // namespace pointwright::server

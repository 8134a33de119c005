#include "server/base/random_id.h"

#include <sys/random.h>

#include <cerrno>
#include <stdexcept>
#include <string_view>
#include <vector>

namespace pointwright::server {

std::string random_id() {
  std::string id = random_text(16);
  // Command lines would take it for an option.
  while (id.front() == '-') id = random_text(16);
  return id;
}

std::string random_text(std::size_t bytes) {
  std::vector<unsigned char> bits(bytes);
  std::size_t have = 0;
  while (have < bits.size()) {
    const ssize_t count = ::getrandom(bits.data() + have, bits.size() - have, 0);
    if (count < 0 && errno != EINTR) throw std::runtime_error("the kernel gives no random numbers");
    if (count > 0) have += static_cast<std::size_t>(count);
  }
  constexpr std::string_view kAlphabet = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_";
  std::string id;
  unsigned accumulator = 0;
  int held = 0;
  for (const unsigned char byte : bits) {
    accumulator = (accumulator << 8U | byte) & 0xffffU;
    held += 8;
    while (held >= 6) {
      held -= 6;
      id.push_back(kAlphabet[accumulator >> static_cast<unsigned>(held) & 63U]);
    }
  }
  if (held > 0) id.push_back(kAlphabet[accumulator << static_cast<unsigned>(6 - held) & 63U]);
  return id;
}

}  // namespace pointwright::server

#include "server/http/transport.h"

#include <poll.h>
#include <sys/socket.h>
#include <sys/types.h>
#include <sys/uio.h>

#include <algorithm>
#include <array>
#include <cerrno>

namespace pointwright::server {
namespace {

constexpr std::size_t kMostPieces = 4;  // in one call

class PlainTransport final : public Transport {
 public:
  explicit PlainTransport(int descriptor) : descriptor_(descriptor) {}

  Moved read(std::span<char> bytes) override {
    while (true) {
      const ssize_t count = ::recv(descriptor_, bytes.data(), bytes.size(), 0);
      if (count > 0) return {.status = Moved::Status::kDone, .count = static_cast<std::size_t>(count)};
      if (count == 0) return {.status = Moved::Status::kEnded};
      if (errno == EINTR) continue;
      const bool waits = errno == EAGAIN || errno == EWOULDBLOCK;
      return {.status = waits ? Moved::Status::kWantRead : Moved::Status::kBroken};
    }
  }

  Moved write(std::span<const std::span<const std::byte>> pieces) override {
    std::array<iovec, kMostPieces> vectors{};
    const std::size_t several = std::min(pieces.size(), kMostPieces);
    for (std::size_t i = 0; i < several; ++i) {
      // The kernel only reads through it.
      vectors[i] = {.iov_base = const_cast<std::byte*>(pieces[i].data()), .iov_len = pieces[i].size()};
    }
    msghdr message{};
    message.msg_iov = vectors.data();
    message.msg_iovlen = several;
    while (true) {
      const ssize_t count = ::sendmsg(descriptor_, &message, MSG_NOSIGNAL);
      if (count >= 0) return {.status = Moved::Status::kDone, .count = static_cast<std::size_t>(count)};
      if (errno == EINTR) continue;
      const bool waits = errno == EAGAIN || errno == EWOULDBLOCK;
      return {.status = waits ? Moved::Status::kWantWrite : Moved::Status::kBroken};
    }
  }

  Moved end() override {
    ::shutdown(descriptor_, SHUT_WR);
    return {.status = Moved::Status::kDone};
  }

  bool is_peer_gone() override {
    pollfd entry{.fd = descriptor_, .events = POLLRDHUP, .revents = 0};
    return ::poll(&entry, 1, 0) > 0 && (entry.revents & (POLLRDHUP | POLLHUP | POLLERR)) != 0;
  }

 private:
  int descriptor_;
};

}  // namespace

std::unique_ptr<Transport> plain_transport(int descriptor) {
  return std::make_unique<PlainTransport>(descriptor);
}

}  // namespace pointwright::server

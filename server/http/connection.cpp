#include "server/http/connection.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <thread>
#include <vector>

#include "server/http/tls.h"

namespace pointwright::server {
namespace {

constexpr std::size_t kLingerDropBytes = 256 * 1024;
constexpr std::size_t kUnaskedBytes = 16 * 1024;
constexpr std::size_t kReadBytes = 64 * 1024;
constexpr std::size_t kPieceBytes = 256 * 1024;
constexpr std::uint64_t kHoldBytes = 4U << 20U;

int poll_timeout(Clock::time_point deadline) {
  const auto left = std::chrono::ceil<std::chrono::milliseconds>(deadline - Clock::now()).count();
  return static_cast<int>(std::clamp<long long>(left, 0, 60'000));
}

/// What came buys time at the least rate, but never more than the grace: nobody saves up for a pause.
Clock::time_point paced(Clock::time_point deadline, std::uint64_t count, Connection::BodyPace pace) {
  const std::chrono::nanoseconds bought(count * 1'000'000'000U / pace.least_rate);
  return std::min(deadline + bought, Clock::now() + pace.grace);
}

/// What is left of the pieces without their first `count` bytes.
std::span<std::span<const std::byte>> past(std::span<std::span<const std::byte>> pieces, std::size_t count) {
  while (!pieces.empty() && count >= pieces.front().size()) {
    count -= pieces.front().size();
    pieces = pieces.subspan(1);
  }
  if (!pieces.empty()) pieces.front() = pieces.front().subspan(count);
  return pieces;
}

}  // namespace

Connection::Connection(int descriptor, const TlsIdentity* tls)
    : descriptor_(descriptor),
      transport_(tls == nullptr ? plain_transport(descriptor) : tls->accept(descriptor)) {
  // The library accepts without these: children must not inherit the socket, small answers must not wait.
  ::fcntl(descriptor, F_SETFD, FD_CLOEXEC);
  ::fcntl(descriptor, F_SETFL, ::fcntl(descriptor, F_GETFL) | O_NONBLOCK);
  const int on = 1;
  ::setsockopt(descriptor, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
}

bool Connection::wait_for(Moved::Status status, Clock::time_point deadline) const {
  const bool reads = status == Moved::Status::kWantRead;
  if (!reads && status != Moved::Status::kWantWrite) return false;
  // At every attempt: bytes that complete nothing do not extend the deadline.
  while (Clock::now() < deadline) {
    pollfd entry{
        .fd = descriptor_.get(), .events = static_cast<short>(reads ? POLLIN : POLLOUT), .revents = 0};
    const int ready = ::poll(&entry, 1, poll_timeout(deadline));
    if (ready > 0) return true;
    if (ready < 0 && errno != EINTR) return true;  // let the call itself report what is wrong
  }
  return false;
}

std::ptrdiff_t Connection::receive(char* data, std::size_t size, Clock::time_point deadline) {
  while (true) {
    const Moved moved = transport_->read(std::span(data, size));
    if (moved.status == Moved::Status::kDone) return static_cast<std::ptrdiff_t>(moved.count);
    if (moved.status == Moved::Status::kBroken) broken_ = true;
    if (moved.status == Moved::Status::kEnded || broken_) return 0;
    if (!wait_for(moved.status, deadline)) return -1;
  }
}

Connection::HeadStatus Connection::read_head(std::size_t max_bytes, Clock::time_point deadline,
                                             std::string& head) {
  std::array<char, 4096> chunk;
  std::size_t searched = 0;
  while (true) {
    const std::size_t end = head.find("\r\n\r\n", searched);
    if (end != std::string::npos && end + 4 <= max_bytes) {
      pending_ = head.substr(end + 4);
      head.resize(end + 4);
      return HeadStatus::kComplete;
    }
    if (head.size() >= max_bytes) return HeadStatus::kTooLarge;
    searched = head.size() < 3 ? 0 : head.size() - 3;
    // An absolute deadline: a byte now and then does not extend it.
    if (Clock::now() >= deadline) return HeadStatus::kTimedOut;
    const std::ptrdiff_t count = receive(chunk.data(), chunk.size(), deadline);
    if (count < 0) return HeadStatus::kTimedOut;
    if (count == 0) return HeadStatus::kClosed;
    head.append(chunk.data(), static_cast<std::size_t>(count));
  }
}

Connection::BodyStatus Connection::read_body(std::uint64_t length, BodyPace pace,
                                             const std::function<bool(std::uint64_t)>& hold,
                                             std::string& body) {
  body = pending_.substr(0, static_cast<std::size_t>(std::min<std::uint64_t>(length, pending_.size())));
  pending_.clear();
  std::uint64_t held = 0;
  Clock::time_point deadline = Clock::now() + pace.grace;
  while (body.size() < length) {
    if (Clock::now() >= deadline) return BodyStatus::kTimedOut;
    const std::size_t before = body.size();
    // Small pieces first: who announces much and sends nothing holds next to nothing.
    while (held < std::min<std::uint64_t>(length, before + kReadBytes)) {
      const std::uint64_t more =
          std::min(length - held, std::clamp<std::uint64_t>(held, kReadBytes, kHoldBytes));
      if (!hold(more)) return BodyStatus::kNoRoom;
      held += more;
    }
    const auto left = static_cast<std::size_t>(length - before);
    body.resize(before + std::min(left, kReadBytes));
    const std::ptrdiff_t count = receive(body.data() + before, body.size() - before, deadline);
    body.resize(before + static_cast<std::size_t>(std::max<std::ptrdiff_t>(count, 0)));
    if (count < 0) return BodyStatus::kTimedOut;
    if (count == 0) return BodyStatus::kClosed;
    deadline = paced(deadline, static_cast<std::uint64_t>(count), pace);
  }
  return BodyStatus::kComplete;
}

Connection::BodyStatus Connection::stream_body(std::uint64_t length, BodyPace pace,
                                               const std::function<bool(std::span<const std::byte>)>& take,
                                               std::uint64_t& count) {
  count = 0;
  const auto hand_over = [&](const char* data, std::size_t size) {
    count += size;
    return take(std::as_bytes(std::span(data, size)));
  };
  const auto early = static_cast<std::size_t>(std::min<std::uint64_t>(length, pending_.size()));
  if (early > 0 && !hand_over(pending_.data(), early)) return BodyStatus::kNoRoom;
  pending_.clear();
  std::vector<char> piece(static_cast<std::size_t>(std::min<std::uint64_t>(length - count, kPieceBytes)));
  Clock::time_point deadline = Clock::now() + pace.grace;
  while (count < length) {
    if (Clock::now() >= deadline) return BodyStatus::kTimedOut;
    const auto want = static_cast<std::size_t>(std::min<std::uint64_t>(length - count, piece.size()));
    const std::ptrdiff_t got = receive(piece.data(), want, deadline);
    if (got < 0) return BodyStatus::kTimedOut;
    if (got == 0) return BodyStatus::kClosed;
    const auto begin = Clock::now();
    if (!hand_over(piece.data(), static_cast<std::size_t>(got))) return BodyStatus::kNoRoom;
    // What the disk takes is not the peer's fault; what came buys time at the least rate.
    deadline = paced(deadline + (Clock::now() - begin), static_cast<std::uint64_t>(got), pace);
  }
  return BodyStatus::kComplete;
}

bool Connection::write_all(std::span<const std::byte> bytes, Clock::time_point deadline) {
  return write_all(std::span(&bytes, 1), deadline);
}

bool Connection::write_all(std::span<std::span<const std::byte>> pieces, Clock::time_point deadline) {
  for (pieces = past(pieces, 0); !pieces.empty() && !broken_;) {
    const Moved moved = transport_->write(pieces);
    if (moved.status == Moved::Status::kDone) {
      pieces = past(pieces, moved.count);
      // A reader that takes a byte at a time must not push the deadline ahead of itself.
      if (!pieces.empty() && Clock::now() >= deadline) broken_ = true;
    } else if (!wait_for(moved.status, deadline)) {
      broken_ = true;
    }
  }
  return !broken_;
}

bool Connection::write_all(std::string_view text, Clock::time_point deadline) {
  return write_all(std::as_bytes(std::span(text.data(), text.size())), deadline);
}

std::string Connection::peer_address() const {
  sockaddr_storage address{};
  socklen_t size = sizeof address;
  std::array<char, INET6_ADDRSTRLEN> text{};
  if (::getpeername(descriptor_.get(), reinterpret_cast<sockaddr*>(&address), &size) != 0) return {};
  const void* number = nullptr;
  if (address.ss_family == AF_INET) number = &reinterpret_cast<const sockaddr_in*>(&address)->sin_addr;
  if (address.ss_family == AF_INET6) number = &reinterpret_cast<const sockaddr_in6*>(&address)->sin6_addr;
  if (number == nullptr || ::inet_ntop(address.ss_family, number, text.data(), text.size()) == nullptr)
    return {};
  return text.data();
}

bool Connection::is_peer_gone() const {
  return broken_ || transport_->is_peer_gone();
}

bool Connection::is_reader_gone() {
  std::array<char, 4096> chunk;
  while (!broken_ && unasked_ <= kUnaskedBytes) {
    const Moved moved = transport_->read(chunk);
    if (moved.status == Moved::Status::kEnded) return true;
    if (moved.status == Moved::Status::kBroken) broken_ = true;
    if (moved.status != Moved::Status::kDone) return is_peer_gone();
    unasked_ += moved.count;
  }
  return true;
}

void Connection::linger(std::chrono::milliseconds patience) {
  if (broken_) return;
  const Clock::time_point deadline = Clock::now() + patience;
  while (wait_for(transport_->end().status, deadline)) {
  }
  std::array<char, 16 * 1024> chunk;
  std::size_t dropped = 0;
  while (Clock::now() < deadline) {
    if (dropped >= kLingerDropBytes) {
      // Enough was read; the peer still gets the time to read our answer before the reset.
      if (is_peer_gone()) return;
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
      continue;
    }
    const std::ptrdiff_t count = receive(chunk.data(), chunk.size(), deadline);
    if (count <= 0) return;
    dropped += static_cast<std::size_t>(count);
  }
}

}  // namespace pointwright::server

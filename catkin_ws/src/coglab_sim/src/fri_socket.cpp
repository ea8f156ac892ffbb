#include "coglab_sim/fri_socket.hpp"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <stdexcept>

namespace coglab_sim {

FriSocket::FriSocket(const std::string& host, std::uint16_t source_port) {
  in_addr peer{};
  if (inet_pton(AF_INET, host.c_str(), &peer) != 1) {
    throw std::runtime_error("FRI host '" + host + "' is not an IPv4 address such as 127.0.0.1");
  }
  address_ = peer.s_addr;
  descriptor_ = socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  sockaddr_in own{};
  own.sin_family = AF_INET;
  own.sin_port = htons(source_port);
  const bool loopback = (ntohl(address_) >> 24U) == 127U;
  own.sin_addr.s_addr = htonl(loopback ? INADDR_LOOPBACK : INADDR_ANY);
  if (descriptor_ < 0 ||
      bind(descriptor_, reinterpret_cast<const sockaddr*>(&own), sizeof(own)) != 0) {
    const std::string reason = std::strerror(errno);
    if (descriptor_ >= 0) close(descriptor_);
    const std::string from = source_port == 0 ? "" : " from port " + std::to_string(source_port);
    throw std::runtime_error("cannot open a UDP socket for FRI toward " + host + from + ": " +
                             reason);
  }
}

FriSocket::~FriSocket() { close(descriptor_); }

bool FriSocket::send(const std::uint8_t* bytes, std::size_t size, std::uint16_t port) {
  sockaddr_in peer{};
  peer.sin_family = AF_INET;
  peer.sin_addr.s_addr = address_;
  peer.sin_port = htons(port);
  return sendto(descriptor_, bytes, size, 0, reinterpret_cast<const sockaddr*>(&peer),
                sizeof(peer)) == static_cast<ssize_t>(size);
}

long FriSocket::receive(std::uint8_t* bytes, std::size_t capacity,
                        std::chrono::steady_clock::time_point deadline) {
  for (;;) {
    sockaddr_in sender{};
    socklen_t length = sizeof(sender);
    const ssize_t size = recvfrom(descriptor_, bytes, capacity, MSG_TRUNC,
                                  reinterpret_cast<sockaddr*>(&sender), &length);
    if (size >= 0) return std::min<long>(size, static_cast<long>(capacity) + 1);
    if (errno != EAGAIN && errno != EWOULDBLOCK && errno != EINTR && errno != ECONNREFUSED)
      return -1;
    const auto left = deadline - std::chrono::steady_clock::now();
    if (left <= std::chrono::nanoseconds::zero()) return -1;
    const auto nanoseconds = std::chrono::duration_cast<std::chrono::nanoseconds>(left).count();
    const timespec timeout{static_cast<time_t>(nanoseconds / 1000000000),
                           static_cast<long>(nanoseconds % 1000000000)};
    pollfd wait{descriptor_, POLLIN, 0};
    ppoll(&wait, 1, &timeout, nullptr);
  }
}

}  // namespace coglab_sim

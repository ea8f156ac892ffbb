/// @file
/// A socket that plays a robot controller on 127.0.0.1, and bounded waits, for the tests of the FRI
/// thread.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <thread>

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#include "lwr_fri_bridge/bridge/fri_thread.hpp"

namespace lwr_fri_bridge::test {

class Peer {
 public:
  explicit Peer(int port, std::uint32_t address = INADDR_LOOPBACK)
      : fd_(socket(AF_INET, SOCK_DGRAM, 0)) {
    sockaddr_in own{};
    own.sin_family = to_.sin_family = AF_INET;
    own.sin_addr.s_addr = htonl(address);
    bind(fd_, reinterpret_cast<sockaddr*>(&own), sizeof own);
    to_.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    to_.sin_port = htons(static_cast<std::uint16_t>(port));
    timeval timeout{};
    timeout.tv_usec = 300'000;
    setsockopt(fd_, SOL_SOCKET, SO_RCVTIMEO, &timeout, sizeof timeout);
  }
  ~Peer() { close(fd_); }
  Peer(const Peer&) = delete;
  Peer& operator=(const Peer&) = delete;
  void send(const void* data, std::size_t size) {
    sendto(fd_, data, size, 0, reinterpret_cast<sockaddr*>(&to_), sizeof to_);
  }
  void send(const fri::MeasurementDatagram& m) { send(&m, sizeof m); }
  bool receive(fri::CommandDatagram& c) {
    return recv(fd_, &c, sizeof c, 0) == static_cast<ssize_t>(sizeof c);
  }
  /// As receive(), for an answer that must come, on a computer that may be busy: within 6 s.
  bool receiveSoon(fri::CommandDatagram& c) {
    for (int i = 0; i < 20; ++i) {
      if (receive(c)) return true;
    }
    return false;
  }

 private:
  int fd_;
  sockaddr_in to_{};
};

/// Returns true if a condition becomes true within 30 s.
inline bool eventually(const std::function<bool()>& condition) {
  for (int i = 0; i < 3000 && !condition(); ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  return condition();
}

/// Any free port, without real-time priority.
inline FriThreadOptions anyPort() {
  FriThreadOptions options;
  options.port = 0;
  options.priority = 0;
  return options;
}

}  // namespace lwr_fri_bridge::test

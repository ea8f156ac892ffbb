/// @file
/// The controller's UDP socket. It sends measurements and receives commands on one port.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>

namespace coglab_sim {

class FriSocket {
 public:
  /// Opens a socket on `source_port` (0: any free port). `host` is the IPv4 address of the peers;
  /// with 127.x.x.x the socket uses the loopback interface only.
  /// @throws std::runtime_error naming address, port and the system's reason.
  explicit FriSocket(const std::string& host, std::uint16_t source_port = 0);
  ~FriSocket();
  FriSocket(const FriSocket&) = delete;
  FriSocket& operator=(const FriSocket&) = delete;

  /// Sends to the host's `port`; returns false only if the operating system refused to send.
  /// Datagrams that get lost or that the receiver refuses are not reported.
  bool send(const std::uint8_t* bytes, std::size_t size, std::uint16_t port);

  /// Waits for a datagram until `deadline`. Returns its size, or -1 if none arrived. A datagram
  /// longer than `capacity` is cut off; the returned size is then capacity + 1.
  long receive(std::uint8_t* bytes, std::size_t capacity,
               std::chrono::steady_clock::time_point deadline);

 private:
  int descriptor_ = -1;
  std::uint32_t address_ = 0;
};

}  // namespace coglab_sim

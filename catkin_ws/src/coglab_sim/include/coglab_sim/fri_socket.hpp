/// @file
/// The controller's UDP socket: sends measurements from the port it receives commands on.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>

namespace coglab_sim {

class FriSocket {
 public:
  /// Opens a socket on `source_port` (0: any free one); peers are reached at `host` (an IPv4
  /// address), for 127.x.x.x on the loopback interface only.
  /// @throws std::runtime_error naming address, port and the system's reason.
  explicit FriSocket(const std::string& host, std::uint16_t source_port = 0);
  ~FriSocket();
  FriSocket(const FriSocket&) = delete;
  FriSocket& operator=(const FriSocket&) = delete;

  /// Sends to the host's `port`; a lost or refused datagram is the receiver's business. False only
  /// if the system refused to send.
  bool send(const std::uint8_t* bytes, std::size_t size, std::uint16_t port);

  /// Waits for a datagram until `deadline`. Returns its size (at most `capacity`; more is cut off
  /// and reported as capacity + 1), or -1 if none came.
  long receive(std::uint8_t* bytes, std::size_t capacity,
               std::chrono::steady_clock::time_point deadline);

 private:
  int descriptor_ = -1;
  std::uint32_t address_ = 0;
};

}  // namespace coglab_sim

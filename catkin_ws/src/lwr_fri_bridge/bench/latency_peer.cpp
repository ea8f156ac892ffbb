/// @file
/// The two processes beside the robot node in coglab_bringup/bench/bench_fri.py, over UDP on
/// 127.0.0.1:
///
///   echo                       bare recv/send: the floor. Prints its port.
///   measure ECHO BRIDGE QUADS  paced 1 kHz controller: blocks of 500 packets in the order echo
///                              bridge bridge echo, QUADS times. Both get a packet in every
///                              millisecond, so that the robot's control cycle runs on during the
///                              blocks of the echo; the one whose block it is gets it first and is
///                              measured. Prints "ready" when the bridge is in command mode and
///                              moves; then per block one line: kind, then the latencies in us, -1
///                              for a missing answer; at last the word moving and the share of the
///                              bridge's answers that moved the arm.
///   monitor ECHO BRIDGE QUADS  the same without waiting for a motion: monitor mode stays.
#include <algorithm>
#include <atomic>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <string>
#include <vector>

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#include "lwr_fri_bridge/bridge/fri_thread.hpp"

namespace {

using namespace lwr_fri_bridge;

constexpr int kPriority = 80;                // of echo and FRI thread alike
constexpr int kBlock = 500;                  // packets
constexpr std::int64_t kPeriod = 1'000'000;  // ns

std::atomic<bool> ended{false};
void onSignal(int) { ended = true; }

int openSocket(sockaddr_in& address, int timeout_us) {
  const int fd = socket(AF_INET, SOCK_DGRAM, 0);
  address = {};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t length = sizeof address;
  if (fd < 0 || bind(fd, reinterpret_cast<sockaddr*>(&address), sizeof address) != 0 ||
      getsockname(fd, reinterpret_cast<sockaddr*>(&address), &length) != 0) {
    std::perror("socket");
    std::exit(1);
  }
  timeval timeout{};
  timeout.tv_usec = timeout_us;
  setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &timeout, sizeof timeout);
  return fd;
}

int echo() {
  sockaddr_in local{}, from{};
  const int fd = openSocket(local, 100'000);
  std::printf("%d\n", ntohs(local.sin_port));
  std::fflush(stdout);
  coglab_rt::enterRealTime(kPriority);
  char buffer[1024];
  while (!ended) {
    socklen_t length = sizeof from;
    if (recvfrom(fd, buffer, sizeof buffer, 0, reinterpret_cast<sockaddr*>(&from), &length) <= 0)
      continue;
    if (sendto(fd, buffer, fri::kCommandSize, 0, reinterpret_cast<sockaddr*>(&from), length) < 0)
      return 1;
  }
  return 0;
}

/// A robot controller that does what it is told, in its resting posture.
struct Controller {
  fri::MeasurementDatagram datagram{};
  std::uint16_t counter = 0;
  std::uint64_t answers = 0, moved = 0;
  Controller() {
    datagram.measurement_period = datagram.command_period = 0.001F;
    datagram.state = 1;
    datagram.quality = 3;
    datagram.control = 1;
    datagram.power = fri::kAllDrivesOn;
    datagram.krl.ints[15] = fri::kCoglabProgramMark;
    for (int i = 0; i < 3; ++i)
      datagram.commanded_frame[5 * i] = datagram.commanded_frame_offset[5 * i] = 1.0F;
    const float home[7] = {-1.4349F, -0.6086F, 1.4986F, 1.7048F, 0.1857F, 0.2152F, 0.782F};
    std::copy(home, home + 7, datagram.commanded_position);
    std::copy(home, home + 7, datagram.measured_position);
  }
  void take(const fri::CommandDatagram& answer) {
    datagram.header.reflected = answer.header.counter;
    if (answer.krl.ints[2] != 0 && answer.krl.ints[2] != datagram.krl.ints[0]) {
      datagram.krl.ints[0] = answer.krl.ints[2];
      datagram.krl.ints[1] = 1;
      datagram.state = answer.krl.ints[0] == 1 ? 2 : 1;
    }
    ++answers;
    bool moves = false;
    for (int i = 0; i < 7; ++i) {
      moves = moves || answer.joint_position[i] != datagram.measured_position[i];
      datagram.measured_position[i] = answer.joint_position[i];
      datagram.commanded_position_offset[i] =
          answer.joint_position[i] - datagram.commanded_position[i];
    }
    if (moves) ++moved;
  }
};

/// Sends packets by turns to the bridge and to the echo, on the beat.
class Exchange {
 public:
  Exchange(int echo_port, int bridge_port)
      : fd_(openSocket(target_, 20'000)), echo_port_(echo_port), bridge_port_(bridge_port) {}

  /// So many packets to one of the two, timed into us(); the other one gets as many beside them.
  void block(bool to_bridge, int packets) {
    for (int i = 0; i < packets; ++i, next_ += kPeriod) {
      // Late ourselves: not the peer's fault.
      if (steadyNow() > next_) next_ = steadyNow() + kPeriod;
      timespec wake{next_ / 1'000'000'000, next_ % 1'000'000'000};
      clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &wake, nullptr);
      us_[static_cast<std::size_t>(i % kBlock)] = exchange(to_bridge);
      exchange(!to_bridge);
    }
  }

  Controller& controller() { return controller_; }
  const std::vector<float>& us() const { return us_; }

 private:
  /// Sends the packet of this millisecond to one of the two and waits for its answer; us.
  float exchange(bool to_bridge) {
    target_.sin_port = htons(static_cast<std::uint16_t>(to_bridge ? bridge_port_ : echo_port_));
    fri::MeasurementDatagram& d = controller_.datagram;
    d.header = fri::measurementHeader(to_bridge ? ++controller_.counter : controller_.counter,
                                      d.header.reflected);
    const std::int64_t sent = steadyNow();
    sendto(fd_, &d, sizeof d, 0, reinterpret_cast<sockaddr*>(&target_), sizeof target_);
    // A late answer of the other one is not mistaken for this one.
    std::uint8_t reply[1024];
    sockaddr_in from{};
    ssize_t got = 0;
    do {
      socklen_t length = sizeof from;
      got = recvfrom(fd_, reply, sizeof reply, 0, reinterpret_cast<sockaddr*>(&from), &length);
    } while (got > 0 && from.sin_port != target_.sin_port);
    const std::int64_t received = steadyNow();
    if (got != static_cast<ssize_t>(fri::kCommandSize)) return -1.0F;
    fri::CommandDatagram answer;
    if (to_bridge && fri::decode(reply, fri::kCommandSize, answer)) controller_.take(answer);
    return 1e-3F * static_cast<float>(received - sent);
  }

  sockaddr_in target_{};
  const int fd_, echo_port_, bridge_port_;
  Controller controller_;
  std::vector<float> us_ = std::vector<float>(kBlock);
  std::int64_t next_ = steadyNow() + kPeriod;
};

int measure(bool moving, int echo_port, int bridge_port, int quads) {
  Exchange peers(echo_port, bridge_port);
  coglab_rt::enterRealTime(kPriority - 5);
  Controller& controller = peers.controller();
  for (int second = 0; moving && second < 60 && !ended; ++second) {
    const std::uint64_t moved = controller.moved;
    peers.block(false, kBlock);
    peers.block(true, kBlock);
    if (controller.datagram.state == 2 && controller.moved > moved + kBlock / 2) break;
  }
  if (moving && (controller.datagram.state != 2 || controller.moved == 0)) {
    std::fprintf(stderr, "the bridge did not move the arm within 60 s\n");
    return 1;
  }
  std::puts("ready");
  std::fflush(stdout);
  controller.answers = controller.moved = 0;
  for (int quad = 0; quad < quads && !ended; ++quad) {
    for (const bool to_bridge : {false, true, true, false}) {
      peers.block(to_bridge, kBlock);
      std::fputs(to_bridge ? "bridge" : "echo", stdout);
      for (const float value : peers.us()) std::printf(" %.1f", static_cast<double>(value));
      std::fputc('\n', stdout);
    }
  }
  std::printf("moving %.4f\n",
              static_cast<double>(controller.moved) /
                  static_cast<double>(std::max<std::uint64_t>(controller.answers, 1)));
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  std::signal(SIGINT, onSignal);
  std::signal(SIGTERM, onSignal);
  const std::string mode = argc > 1 ? argv[1] : "";
  if (mode == "echo") return echo();
  if ((mode == "measure" || mode == "monitor") && argc == 5)
    return measure(mode == "measure", std::atoi(argv[2]), std::atoi(argv[3]), std::atoi(argv[4]));
  std::fprintf(stderr, "usage: %s echo | measure|monitor ECHO_PORT BRIDGE_PORT QUADS\n", argv[0]);
  return 2;
}

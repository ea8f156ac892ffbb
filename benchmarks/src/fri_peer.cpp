/// The two programs beside the robot node in wire.py, over UDP on 127.0.0.1:
///
///   echo                       bare recv and send: the floor. Prints its port.
///   measure ECHO BRIDGE QUADS  a paced 1 kHz controller: blocks of 500 packets in the order echo,
///                              bridge, bridge, echo, QUADS times. Both get a packet in every
///                              millisecond; the one whose block it is gets it first and is timed.
///                              Prints "ready" when the bridge moves the arm; per block its kind
///                              and the latencies in us (-1: no answer); "moving" and the share of
///                              the answers that moved the arm; "missing" and the packets to the
///                              bridge without an answer within 20 ms.
///   monitor ECHO BRIDGE QUADS  the same without waiting for a motion.
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
#include <poll.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#include "lwr_fri_bridge/bridge/fri_thread.hpp"

namespace {

using namespace lwr_fri_bridge;

constexpr int kPriority = 80;                   // of echo and FRI thread alike
constexpr int kBlock = 500;                     // packets
constexpr std::int64_t kPeriod = 1'000'000;     // ns
constexpr std::int64_t kPatience = 20'000'000;  // ns, within which an answer has to come

std::atomic<bool> ended{false};
/// Ends the loops of both programs.
void onSignal(int) { ended = true; }

/// A UDP socket on a free local port, which is written into the address; it waits so long.
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

/// Sends the head of each datagram back, as long as a command, until a signal ends it.
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
  std::uint64_t answers = 0, moved = 0;
  /// At rest at home, in monitor mode.
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
  /// Follows an answer: goes where it says, and changes the mode if it asks for that.
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

/// One of the two programs that get packets.
struct Peer {
  in_port_t port = 0;          // network order
  std::uint16_t question = 0;  // counter of the packet that was sent last
  std::uint64_t missing = 0;   // packets without an answer in time
};

/// Sends one packet to the bridge and one to the echo in each period.
class Exchange {
 public:
  Exchange(int echo_port, int bridge_port) : fd_(openSocket(target_, kPatience / 1000)) {
    echo_.port = htons(static_cast<std::uint16_t>(echo_port));
    bridge_.port = htons(static_cast<std::uint16_t>(bridge_port));
  }

  /// Sends `packets` packets to one peer; us() has the times of its answers. Sends as many to the
  /// other peer, without timing. Missing answers of both are counted.
  void block(bool to_bridge, int packets) {
    Peer& first = to_bridge ? bridge_ : echo_;
    Peer& second = to_bridge ? echo_ : bridge_;
    for (int i = 0; i < packets; ++i, next_ += kPeriod) {
      // Late ourselves: not the peer's fault.
      if (steadyNow() > next_) next_ = steadyNow() + kPeriod;
      timespec wake{next_ / 1'000'000'000, next_ % 1'000'000'000};
      clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &wake, nullptr);
      us_[static_cast<std::size_t>(i % kBlock)] = exchange(first);
      exchange(second);
    }
  }

  Controller& controller() { return controller_; }
  const std::vector<float>& us() const { return us_; }
  std::uint64_t missing() const { return bridge_.missing; }

 private:
  /// Sends the packet of this millisecond to one of the two and waits for its answer; us, or -1 if
  /// none came in time.
  float exchange(Peer& peer) {
    target_.sin_port = peer.port;
    fri::MeasurementDatagram& d = controller_.datagram;
    d.header = fri::measurementHeader(++peer.question, d.header.reflected);
    const std::int64_t sent = steadyNow();
    sendto(fd_, &d, sizeof d, 0, reinterpret_cast<sockaddr*>(&target_), sizeof target_);
    std::int64_t took = 0;
    for (bool came = receive(); came && took <= kPatience; came = receiveUntil(sent + kPatience)) {
      took = steadyNow() - sent;
      if (took <= kPatience && isAnswerOf(peer)) {
        fri::CommandDatagram answer;
        if (&peer == &bridge_ && fri::decode(reply_, fri::kCommandSize, answer))
          controller_.take(answer);
        return 1e-3F * static_cast<float>(took);
      }
    }
    ++peer.missing;
    return -1.0F;
  }

  /// The next datagram, whatever it is; false if none came within the socket's limit of time.
  bool receive() {
    socklen_t length = sizeof from_;
    got_ = recvfrom(fd_, reply_, sizeof reply_, 0, reinterpret_cast<sockaddr*>(&from_), &length);
    return got_ > 0;
  }

  /// Receives the next datagram after one that was not the answer: waits for the rest of the time
  /// limit.
  bool receiveUntil(std::int64_t deadline) {
    const std::int64_t left = std::max<std::int64_t>(deadline - steadyNow(), 0);
    const timespec limit{left / 1'000'000'000, left % 1'000'000'000};
    pollfd waited{fd_, POLLIN, 0};
    return ppoll(&waited, 1, &limit, nullptr) > 0 && receive();
  }

  /// Whether the datagram that came last answers the last question to that peer: the bridge
  /// reflects its counter, and the echo sends it back where it was.
  bool isAnswerOf(const Peer& peer) const {
    if (from_.sin_port != peer.port || got_ != static_cast<ssize_t>(fri::kCommandSize))
      return false;
    fri::Header header;
    std::memcpy(&header, reply_, sizeof header);
    return &peer == &bridge_ ? header.id == fri::kCommandId && header.reflected == peer.question
                             : header.counter == peer.question;
  }

  sockaddr_in target_{};
  const int fd_;
  Peer echo_, bridge_;
  Controller controller_;
  std::vector<float> us_ = std::vector<float>(kBlock);
  std::int64_t next_ = steadyNow() + kPeriod;
  std::uint8_t reply_[1024];
  sockaddr_in from_{};
  ssize_t got_ = 0;
};

/// The blocks of both peers, printed; moving: after the bridge has begun to move the arm.
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
  std::printf("missing %llu\n", static_cast<unsigned long long>(peers.missing()));
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

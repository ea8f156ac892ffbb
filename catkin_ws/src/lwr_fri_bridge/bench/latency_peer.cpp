/// @file
/// The three processes of bench_fri.py, all over UDP on 127.0.0.1:
///
///   echo                          bare recv/send: the floor. Prints its port.
///   bridge LIMITS_FILE            FRI thread with the whole bridge in command mode, and a control
///   thread that is woken every 5 ms
///                                 and moves the arm. Prints its port.
///   measure ECHO BRIDGE QUADS     paced 1 kHz controller: blocks of 500 packets in the order echo
///   bridge bridge echo, QUADS
///                                 times. Prints per block one line: kind, then the latencies in
///                                 us, -1 for a missing answer.
#include <atomic>
#include <cerrno>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <string>
#include <thread>
#include <vector>

#include <arpa/inet.h>
#include <netinet/in.h>
#include <semaphore.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#include "lwr_fri_bridge/fri_thread.hpp"

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
  enterRealTime(kPriority);
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

int bridge(const char* limits_file) {
  BridgeConfig config;
  config.limits = loadJointLimits(limits_file);
  config.receive_timeout = 5.0;  // the other peer's blocks are no silence
  Bridge bridge(config);
  sem_t due;
  sem_init(&due, 0, 0);
  int ticks = 0;
  FriThreadOptions options;
  options.port = 0;
  options.priority = kPriority;
  options.after_answer = [&](bool) {
    if (++ticks % 5 == 0) sem_post(&due);
  };
  FriThread fri(bridge, options);
  lockMemory();
  fri.start();
  std::printf("%d\n", fri.port());
  std::fflush(stdout);
  BoundedThread control;
  control.start("control", 256 * 1024, [&] {
    enterRealTime(kPriority - 10);
    RobotSample sample;
    while (!ended) {
      sem_wait(&due);
      bridge.port().newestSample(sample);
      const std::int64_t now = steadyNow();
      Vector7 velocity =
          Vector7::Constant(0.2 * std::sin(2e-9 * static_cast<double>(now % 1'000'000'000'000)));
      // About the work of a control cycle: some kinematics.
      for (int i = 0; i < 20; ++i)
        velocity[0] += 1e-9 * flangePose(sample.position).translation().x();
      bridge.port().sendVelocity({velocity, now, sample.motion_epoch});
    }
  });
  while (!ended) {
    if (bridge.snapshot().supervisor == SupervisorState::Monitor) bridge.command("start");
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  sem_post(&due);
  control.join();
  fri.stop();
  return 0;
}

struct Controller {
  fri::MeasurementDatagram datagram{};
  std::uint16_t counter = 0;
  Controller() {
    datagram.measurement_period = datagram.command_period = 0.001F;
    datagram.state = 1;
    datagram.quality = 3;
    datagram.control = 1;
    datagram.power = fri::kAllDrivesOn;
    datagram.krl.ints[15] = fri::kCoglabProgramMark;
    for (int i = 0; i < 3; ++i)
      datagram.commanded_frame[5 * i] = datagram.commanded_frame_offset[5 * i] = 1.0F;
  }
  void take(const fri::CommandDatagram& answer) {
    datagram.header.reflected = answer.header.counter;
    if (answer.krl.ints[0] == 1) datagram.state = 2;
    for (int i = 0; i < 7; ++i)
      datagram.measured_position[i] = datagram.commanded_position_offset[i] =
          answer.joint_position[i];
  }
};

int measure(int echo_port, int bridge_port, int quads) {
  sockaddr_in local{}, target{};
  const int fd = openSocket(local, 20'000);
  enterRealTime(kPriority - 5);
  target = local;
  Controller controller;
  std::uint8_t reply[1024];
  std::vector<float> us(kBlock);
  std::int64_t next = steadyNow() + kPeriod;
  const auto block = [&](bool to_bridge, int packets) {
    target.sin_port = htons(static_cast<std::uint16_t>(to_bridge ? bridge_port : echo_port));
    for (int i = 0; i < packets; ++i, next += kPeriod) {
      if (steadyNow() > next) next = steadyNow() + kPeriod;  // late ourselves: not the peer's fault
      timespec wake{next / 1'000'000'000, next % 1'000'000'000};
      clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &wake, nullptr);
      fri::MeasurementDatagram& d = controller.datagram;
      d.header = fri::measurementHeader(++controller.counter, d.header.reflected);
      if (!to_bridge) --controller.counter;
      const std::int64_t sent = steadyNow();
      sendto(fd, &d, sizeof d, 0, reinterpret_cast<sockaddr*>(&target), sizeof target);
      const ssize_t got = recv(fd, reply, sizeof reply, 0);
      const std::int64_t received = steadyNow();
      us[static_cast<std::size_t>(i % kBlock)] = got == static_cast<ssize_t>(fri::kCommandSize)
                                                     ? 1e-3F * static_cast<float>(received - sent)
                                                     : -1.0F;
      fri::CommandDatagram answer;
      if (to_bridge && fri::decode(reply, fri::kCommandSize, answer) && got > 0)
        controller.take(answer);
    }
  };
  block(false, kBlock);
  block(true, 3 * kBlock);  // until command mode
  if (controller.datagram.state != 2) {
    std::fprintf(stderr, "the bridge did not ask for command mode\n");
    return 1;
  }
  for (int quad = 0; quad < quads && !ended; ++quad) {
    for (const bool to_bridge : {false, true, true, false}) {
      block(to_bridge, kBlock);
      std::fputs(to_bridge ? "bridge" : "echo", stdout);
      for (const float value : us) std::printf(" %.1f", static_cast<double>(value));
      std::fputc('\n', stdout);
    }
  }
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  std::signal(SIGINT, onSignal);
  std::signal(SIGTERM, onSignal);
  const std::string mode = argc > 1 ? argv[1] : "";
  if (mode == "echo") return echo();
  if (mode == "bridge" && argc == 3) return bridge(argv[2]);
  if (mode == "measure" && argc == 5)
    return measure(std::atoi(argv[2]), std::atoi(argv[3]), std::atoi(argv[4]));
  std::fprintf(stderr,
               "usage: %s echo | bridge LIMITS_FILE | measure ECHO_PORT BRIDGE_PORT QUADS\n",
               argv[0]);
  return 2;
}

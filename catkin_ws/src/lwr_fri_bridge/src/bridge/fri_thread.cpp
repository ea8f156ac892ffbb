#include "lwr_fri_bridge/bridge/fri_thread.hpp"

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <ctime>
#include <stdexcept>
#include <thread>

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

namespace lwr_fri_bridge {
namespace {

constexpr int kBatch = 8;
constexpr std::size_t kBuffer =
    1024;  // larger than any valid datagram; a truncated one has a wrong size anyway
constexpr std::int64_t kIdleTick_ns = 10'000'000;

std::uint64_t endpointOf(const sockaddr_in& address) {
  return (static_cast<std::uint64_t>(ntohl(address.sin_addr.s_addr)) << 16) |
         ntohs(address.sin_port);
}

std::string nameOf(std::uint64_t endpoint) {
  if (endpoint == 0) return {};
  in_addr address{};
  address.s_addr = htonl(static_cast<std::uint32_t>(endpoint >> 16));
  char text[INET_ADDRSTRLEN] = {};
  inet_ntop(AF_INET, &address, text, sizeof text);
  return std::string(text) + ":" + std::to_string(endpoint & 0xFFFF);
}

[[noreturn]] void failSocket(int socket, const std::string& what, const FriThreadOptions& options) {
  const std::string reason = std::strerror(errno);
  if (socket >= 0) close(socket);
  throw std::runtime_error(
      "FRI socket: cannot " + what + " " + options.address + ":" + std::to_string(options.port) +
      " (" + reason + "); is another bridge running, is fri_address an address of this computer?");
}

}  // namespace

struct FriThread::Batch {
  std::uint8_t bytes[kBatch][kBuffer];
  ssize_t size[kBatch];
  sockaddr_in from[kBatch];
};

FriThread::FriThread(Bridge& bridge, FriThreadOptions options)
    : bridge_(bridge), options_(std::move(options)) {}

FriThread::~FriThread() { stop(); }

std::string FriThread::start(int preferred_port) {
  stop();
  sockaddr_in local{};
  local.sin_family = AF_INET;
  if (options_.port < 0 || options_.port > 65535) {
    throw std::runtime_error("fri_port = " + std::to_string(options_.port) +
                             " is outside its range 0..65535");
  }
  if (inet_pton(AF_INET, options_.address.c_str(), &local.sin_addr) != 1) {
    throw std::runtime_error("fri_address = '" + options_.address +
                             "' is not an IPv4 address such as 192.168.0.20");
  }
  in_addr controller{};
  if (!options_.controller_address.empty() &&
      inet_pton(AF_INET, options_.controller_address.c_str(), &controller) != 1) {
    throw std::runtime_error("controller_address = '" + options_.controller_address +
                             "' is not an IPv4 address such as 192.168.0.20, nor empty (the first "
                             "that sends valid measurements)");
  }
  controller_ = ntohl(controller.s_addr);
  local_ = ntohl(local.sin_addr.s_addr);
  const int fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  if (fd < 0) failSocket(fd, "open a socket for", options_);
  const auto bindTo = [&](int port) {
    local.sin_port = htons(static_cast<std::uint16_t>(port));
    return bind(fd, reinterpret_cast<sockaddr*>(&local), sizeof local) == 0;
  };
  const bool preferred = options_.port == 0 && preferred_port > 0 && preferred_port <= 65535;
  if (!(preferred && bindTo(preferred_port)) && !bindTo(options_.port))
    failSocket(fd, "bind", options_);
  socklen_t length = sizeof local;
  if (getsockname(fd, reinterpret_cast<sockaddr*>(&local), &length) != 0)
    failSocket(fd, "query", options_);
  timeval timeout{};
  timeout.tv_usec = kIdleTick_ns / 1000;
  if (setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &timeout, sizeof timeout) != 0)
    failSocket(fd, "configure", options_);

  socket_ = fd;
  bound_port_ = ntohs(local.sin_port);
  stopping_ = false;
  scheduling_ = 0;
  thread_.start("fri", options_.stack_bytes, [this] { run(); });
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(2);
  while (scheduling_ == 0 && std::chrono::steady_clock::now() < deadline) {
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  return scheduling_ == 2 ? scheduling_warning_ : std::string();
}

void FriThread::stop() {
  stopping_ = true;
  thread_.join();
  if (socket_ >= 0) close(socket_);
  socket_ = -1;
}

/// Waits for datagrams, at most one idle tick. Returns their number. If it is 0, errno has the
/// reason.
int FriThread::receive(Batch& batch) {
  const auto take = [&](int slot, int flags) {
    socklen_t length = sizeof batch.from[slot];
    batch.size[slot] = recvfrom(socket_, batch.bytes[slot], kBuffer, flags,
                                reinterpret_cast<sockaddr*>(&batch.from[slot]), &length);
    return batch.size[slot] >= 0;
  };
  const std::int64_t began = steadyNow();
  int received = take(0, 0) ? 1 : 0;
  const std::int64_t now = steadyNow();
  if (received == 0 && now - began > 2 * kIdleTick_ns) {
    // This thread ran too late after its time-out. If a datagram came meanwhile, there is no
    // silence.
    bridge_.noteLate(1e-9 * static_cast<double>(now - began - kIdleTick_ns));
    received = take(0, MSG_DONTWAIT) ? 1 : 0;
  }
  if (received == 0) return 0;
  // More datagrams can wait only if this one did not arrive one cycle after the last one.
  const auto interval = static_cast<double>(now - last_receive_ns_);
  const double cycle_ns = 1e9 * bridge_.cycleTime();
  last_receive_ns_ = now;
  if (interval < 0.5 * cycle_ns || interval > 1.5 * cycle_ns) {
    while (received < kBatch && take(received, MSG_DONTWAIT)) ++received;
  }
  return received;
}

void FriThread::run() {
  if (options_.priority > 0) scheduling_warning_ = coglab_rt::enterRealTime(options_.priority);
  scheduling_ = options_.priority <= 0 ? 3 : scheduling_warning_.empty() ? 1 : 2;

  Batch batch;
  std::memset(&batch, 0, sizeof batch);
  std::int64_t last_tick = last_receive_ns_ = steadyNow();
  while (!stopping_.load(std::memory_order_relaxed)) {
    const int received = receive(batch);
    const int error = received > 0 ? 0 : errno;
    const std::int64_t now = steadyNow();
    const std::uint64_t before = answers_.load(std::memory_order_relaxed);
    if (received > 0) serve(batch, received, now);
    if (answers_.load(std::memory_order_relaxed) != before) {
      last_tick = now;
    } else if (now - last_tick >= kIdleTick_ns) {
      last_tick = now;
      bridge_.idle(now);
      if (!bridge_.connected()) peer_.store(0, std::memory_order_relaxed);
      if (options_.after_answer) options_.after_answer(false);
    }
    if (error != 0 && error != EAGAIN && error != EWOULDBLOCK && error != EINTR) {
      // For example, the network reports an unreachable port. The pause avoids a busy loop.
      timespec pause{0, 1'000'000};
      nanosleep(&pause, nullptr);
    }
  }
}

/// True if datagrams from this endpoint can be the controller's.
bool FriThread::isController(std::uint64_t endpoint) const {
  const std::uint64_t peer = peer_.load(std::memory_order_relaxed);
  if (peer != 0) return endpoint == peer;
  return controller_ == 0 || (endpoint >> 16) == controller_;
}

void FriThread::serve(Batch& batch, int received, std::int64_t now_ns) {
  bool answered = false;
  int waiting = -1;  // waiting datagrams of the controller, without the newest
  for (int i = 0; i < received; ++i) waiting += isController(endpointOf(batch.from[i])) ? 1 : 0;
  if (waiting > 0) bridge_.noteLate(waiting * bridge_.cycleTime());
  for (int i = received - 1; i >= 0; --i) {
    const std::uint64_t from = endpointOf(batch.from[i]);
    if (!isController(from)) {
      foreign_.fetch_add(1, std::memory_order_relaxed);
      last_foreign_.store(from, std::memory_order_relaxed);
      continue;
    }
    if (answered) {
      superseded_.fetch_add(1, std::memory_order_relaxed);
      continue;
    }
    fri::CommandDatagram answer;
    if (!bridge_.compute(batch.bytes[i], static_cast<std::size_t>(batch.size[i]), now_ns, answer))
      continue;
    const ssize_t sent = sendto(socket_, &answer, sizeof answer, 0,
                                reinterpret_cast<sockaddr*>(&batch.from[i]), sizeof batch.from[i]);
    bridge_.publish();
    if (sent != static_cast<ssize_t>(sizeof answer))
      send_errors_.fetch_add(1, std::memory_order_relaxed);
    answered = true;
    peer_.store(from, std::memory_order_relaxed);
    bridge_.setControllerHere((from >> 40) == 127 || (from >> 16) == local_);
  }
  if (!answered) return;

  answers_.fetch_add(1, std::memory_order_relaxed);
  answer_times_.add(static_cast<float>(1e-9 * static_cast<double>(steadyNow() - now_ns)));
  if (options_.after_answer) options_.after_answer(true);
}

FriThreadStatistics FriThread::statistics(bool restart_longest) {
  FriThreadStatistics s;
  s.answers = answers_;
  s.superseded = superseded_;
  s.foreign = foreign_;
  s.send_errors = send_errors_;
  s.peer = nameOf(peer_);
  s.last_foreign = nameOf(last_foreign_);
  s.mean_answer_time = answer_times_.mean();
  s.longest_answer_time = answer_times_.longest(restart_longest);
  s.real_time = scheduling_ == 1;
  return s;
}

}  // namespace lwr_fri_bridge

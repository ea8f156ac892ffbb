#include "coglab_controllers/remote/slot.hpp"

#include <cerrno>
#include <cstddef>
#include <cstring>
#include <new>
#include <sstream>
#include <stdexcept>

#include <fcntl.h>
#include <poll.h>
#include <pthread.h>
#include <sys/eventfd.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

namespace coglab_controllers {

namespace {

constexpr int kGreetingTime_ms = 1000;  // after it a process that sends no greeting is disconnected

std::string failed(const std::string& address, const char* what) {
  return "slot " + address + ": " + what + " failed: " + std::strerror(errno);
}

bool answer(int connection, const std::string& text, int memory) {
  iovec part{const_cast<char*>(text.data()), text.size()};
  msghdr message{};
  message.msg_iov = &part;
  message.msg_iovlen = 1;
  alignas(cmsghdr) char control[CMSG_SPACE(sizeof(int))] = {};
  if (memory >= 0) {
    message.msg_control = control;
    message.msg_controllen = sizeof(control);
    cmsghdr* const header = CMSG_FIRSTHDR(&message);
    header->cmsg_level = SOL_SOCKET;
    header->cmsg_type = SCM_RIGHTS;
    header->cmsg_len = CMSG_LEN(sizeof(int));
    std::memcpy(CMSG_DATA(header), &memory, sizeof(int));
  }
  return ::sendmsg(connection, &message, MSG_NOSIGNAL | MSG_DONTWAIT) >= 0;
}

}  // namespace

RemoteSlot::RemoteSlot(const std::string& id, RemoteKind kind)
    : kind_(kind),
      address_("coglab/" + std::to_string(::getuid()) + "/" + std::to_string(::getpid()) + "/" +
               id) {
  try {
    sockaddr_un name{};
    name.sun_family = AF_UNIX;
    if (address_.size() + 1 > sizeof(name.sun_path)) {
      throw std::runtime_error("slot " + address_ + ": the name is too long; give it a shorter id");
    }
    std::memcpy(name.sun_path + 1, address_.data(), address_.size());
    memory_ = ::memfd_create("coglab_slot", MFD_CLOEXEC | MFD_ALLOW_SEALING);
    if (memory_ < 0) throw std::runtime_error(failed(address_, "memfd_create"));
    if (::ftruncate(memory_, sizeof(RemoteSegment)) != 0)
      throw std::runtime_error(failed(address_, "ftruncate"));
    if (::fcntl(memory_, F_ADD_SEALS, F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_SEAL) != 0)
      throw std::runtime_error(failed(address_, "sealing the memory"));
    // MAP_POPULATE: no page fault in the cycle.
    void* const place = ::mmap(nullptr, sizeof(RemoteSegment), PROT_READ | PROT_WRITE,
                               MAP_SHARED | MAP_POPULATE, memory_, 0);
    if (place == MAP_FAILED) throw std::runtime_error(failed(address_, "mmap"));
    segment_ = new (place) RemoteSegment;
    end_ = ::eventfd(0, EFD_CLOEXEC);
    listener_ = ::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (end_ < 0 || listener_ < 0) throw std::runtime_error(failed(address_, "socket"));
    const auto length =
        static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + 1 + address_.size());
    if (::bind(listener_, reinterpret_cast<const sockaddr*>(&name), length) != 0)
      throw std::runtime_error(failed(address_, "bind"));
    if (::listen(listener_, 4) != 0) throw std::runtime_error(failed(address_, "listen"));
    thread_ = std::thread([this] { serve(); });
    ::pthread_setname_np(thread_.native_handle(), "remote_slot");
  } catch (...) {
    clear();
    throw;
  }
}

RemoteSlot::~RemoteSlot() {
  const std::uint64_t one = 1;
  if (::write(end_, &one, sizeof(one)) == sizeof(one)) thread_.join();
  clear();
}

void RemoteSlot::clear() noexcept {
  if (segment_ != nullptr) ::munmap(segment_, sizeof(RemoteSegment));
  for (const int file : {client_, listener_, end_, memory_}) {
    if (file >= 0) ::close(file);
  }
}

/// Body of the thread: waits for processes, and for the end of the one that holds the slot.
void RemoteSlot::serve() {
  while (true) {
    // Only the end of the client is expected. poll() ignores a negative descriptor.
    pollfd files[] = {{end_, POLLIN, 0}, {listener_, POLLIN, 0}, {client_, POLLRDHUP, 0}};
    if (::poll(files, 3, -1) < 0 && errno != EINTR) return;
    if (files[0].revents != 0) return;
    if (files[2].revents != 0) {
      owner_.store(0, std::memory_order_release);
      ::close(client_);
      client_ = -1;
    }
    if (files[1].revents == 0) continue;
    const int connection = ::accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK);
    if (connection < 0) {
      // For example no free descriptor: pause, so that the loop does not run at full speed.
      pollfd pause{end_, POLLIN, 0};
      ::poll(&pause, 1, 100);
      continue;
    }
    greet(connection);
    if (connection != client_) ::close(connection);
  }
}

void RemoteSlot::greet(int connection) {
  pollfd files[] = {{end_, POLLIN, 0}, {connection, POLLIN, 0}};
  if (::poll(files, 2, kGreetingTime_ms) <= 0 || files[0].revents != 0) return;
  char text[256];
  const ssize_t size = ::recv(connection, text, sizeof(text), MSG_DONTWAIT);
  if (size <= 0) return;
  ucred who{};
  socklen_t length = sizeof(who);
  if (::getsockopt(connection, SOL_SOCKET, SO_PEERCRED, &who, &length) != 0) return;
  const std::string refusal = judge(std::string(text, static_cast<std::size_t>(size)), who.uid);
  if (!refusal.empty()) {
    answer(connection, refusal, -1);
    return;
  }
  if (!answer(connection, "welcome", memory_)) return;
  client_ = connection;
  owner_.store(who.pid > 0 ? who.pid : -1, std::memory_order_release);
}

/// Returns the answer to a process that is refused: "taken" if another process holds the slot, else
/// "refused", and a sentence. Empty: accepted.
std::string RemoteSlot::judge(const std::string& hello, unsigned user) const {
  if (user != ::getuid())
    return "refused the robot runs as user " + std::to_string(::getuid()) +
           ", the process as user " + std::to_string(user) + "; run it as the robot's user";
  std::istringstream words(hello);
  std::string protocol;
  long interface = 0, kind = 0;
  std::size_t question = 0, answer = 0;
  words >> protocol >> interface >> kind >> question >> answer;
  if (!words || protocol != "coglab-slot")
    return "refused expected the greeting of a CogLab controller; use ./coglab controller run";
  if (interface != kRemoteInterface || question != kQuestionSize || answer != kAnswerSize)
    return "refused the robot has interface " + std::to_string(kRemoteInterface) + " (" +
           std::to_string(kQuestionSize) + " and " + std::to_string(kAnswerSize) +
           " bytes), the process has " + std::to_string(interface) + " (" +
           std::to_string(question) + " and " + std::to_string(answer) +
           " bytes); build both from the same version";
  if (kind != static_cast<long>(kind_))
    return kind_ == RemoteKind::Motion
               ? "refused this slot is for a motion; the file has a feedback controller"
               : "refused this slot is for a feedback controller; the file has a motion";
  if (connected())
    return "taken process " + std::to_string(owner()) +
           " holds this slot and is running; end it first, or use another slot";
  return "";
}

}  // namespace coglab_controllers

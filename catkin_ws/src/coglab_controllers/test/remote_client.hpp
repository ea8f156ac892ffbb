// A process that connects to a slot of the control cycle, as Python does.
#pragma once

#include <cstddef>
#include <cstring>
#include <string>

#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include "coglab_controllers/remote/slot.hpp"

namespace coglab_controllers {

inline std::string addressOf(const std::string& id) {
  return "coglab/" + std::to_string(::getuid()) + "/" + std::to_string(::getpid()) + "/" + id;
}

inline std::string helloOf(RemoteKind kind, int interface = kRemoteInterface) {
  return "coglab-slot " + std::to_string(interface) + " " + std::to_string(static_cast<int>(kind)) +
         " " + std::to_string(kQuestionSize) + " " + std::to_string(kAnswerSize);
}

/// Connects as a process does. Returns the socket, the robot's answer and the memory.
struct Connection {
  Connection(const std::string& address, const std::string& hello) {
    file = ::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0);
    sockaddr_un name{};
    name.sun_family = AF_UNIX;
    std::memcpy(name.sun_path + 1, address.data(), address.size());
    const auto length =
        static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + 1 + address.size());
    if (::connect(file, reinterpret_cast<sockaddr*>(&name), length) != 0) return;
    if (::send(file, hello.data(), hello.size(), MSG_NOSIGNAL) < 0) return;
    iovec part{text, sizeof(text) - 1};
    msghdr message{};
    alignas(cmsghdr) char control[CMSG_SPACE(sizeof(int))];
    message.msg_iov = &part;
    message.msg_iovlen = 1;
    message.msg_control = control;
    message.msg_controllen = sizeof(control);
    if (::recvmsg(file, &message, 0) <= 0) return;
    if (const cmsghdr* const header = CMSG_FIRSTHDR(&message))
      std::memcpy(&memory, CMSG_DATA(header), sizeof(int));
  }
  ~Connection() {
    ::close(file);
    if (memory >= 0) ::close(memory);
  }
  RemoteSegment* map() const {
    void* const place =
        ::mmap(nullptr, sizeof(RemoteSegment), PROT_READ | PROT_WRITE, MAP_SHARED, memory, 0);
    return place == MAP_FAILED ? nullptr : static_cast<RemoteSegment*>(place);
  }

  int file = -1, memory = -1;
  char text[512] = {};
};

}  // namespace coglab_controllers

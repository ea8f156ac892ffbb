#include "loading/library_file.hpp"

#include <fcntl.h>
#include <poll.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <stdexcept>
#include <system_error>
#include <thread>

#include "coglab_rt/library_length.hpp"
#include "ctrl_more/loading/search_path.hpp"

namespace fs = std::filesystem;
using std::chrono::steady_clock;

namespace ctrl_more {
namespace {

constexpr std::chrono::seconds kProbeTime{5};  // longest time for opening and describing

[[noreturn]] void refuse(const std::string& file, const std::string& clause) {
  throw std::runtime_error("library " + file + " " + clause);
}

/// A running process of the program ctrl_more_probe.
class Probe {
 public:
  explicit Probe(const std::string& library) {
    int pipe[2];
    if (pipe2(pipe, O_CLOEXEC) != 0) throw std::system_error(errno, std::generic_category());
    report_ = pipe[0];
    const int error = start(library, pipe[1]);
    close(pipe[1]);
    if (error == 0) return;
    close(report_);
    throw std::runtime_error(std::string("ctrl_more_probe, which tries libraries, cannot be ") +
                             "started: " + std::strerror(error) + "; build ctrl_more again");
  }
  ~Probe() {
    kill(-pid_, SIGKILL);  // including all processes that the library started
    while (waitpid(pid_, nullptr, 0) < 0 && errno == EINTR) {
    }
    close(report_);
  }
  Probe(const Probe&) = delete;
  Probe& operator=(const Probe&) = delete;

  /// Last line of its report, at its end or at the deadline.
  std::string lastLine(steady_clock::time_point deadline) const {
    std::string text;
    const std::string end = std::string(kProbeDone) + "\n";
    while (text.size() < end.size() || text.compare(text.size() - end.size(), end.size(), end)) {
      pollfd wait{report_, POLLIN, 0};
      const auto left =
          std::chrono::ceil<std::chrono::milliseconds>(deadline - steady_clock::now());
      if (left.count() <= 0) break;
      const int ready = poll(&wait, 1, static_cast<int>(left.count()));
      if (ready < 0 && errno == EINTR) continue;
      char part[512];
      const ssize_t count = ready > 0 ? read(report_, part, sizeof part) : 0;
      if (count <= 0) break;
      text.append(part, static_cast<std::size_t>(count));
    }
    while (!text.empty() && text.back() == '\n') text.pop_back();
    return text.substr(text.rfind('\n') + 1);
  }

  /// Waits for its end, at most until the deadline. Returns how it ended, for an error message.
  std::string end(steady_clock::time_point deadline) const {
    siginfo_t info{};
    while (waitid(P_PID, static_cast<id_t>(pid_), &info, WEXITED | WNOHANG | WNOWAIT) == 0 &&
           info.si_pid == 0) {
      if (steady_clock::now() >= deadline) {
        return "did not return within " + std::to_string(kProbeTime.count()) + " s";
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    if (info.si_code == CLD_EXITED) return "ended the process";
    return std::string("crashed (") + strsignal(info.si_status) + ")";
  }

 private:
  int start(const std::string& library, int report) {
    std::string program = "ctrl_more_probe";  // in PATH
    for (const char* place : {"/ctrl_more/ctrl_more_probe", "/ctrl_more_probe"}) {
      if (access((coreFolder() + place).c_str(), X_OK) == 0) program = coreFolder() + place;
    }
    posix_spawn_file_actions_t files;
    posix_spawn_file_actions_init(&files);
    posix_spawn_file_actions_addopen(&files, 0, "/dev/null", O_RDONLY, 0);
    posix_spawn_file_actions_addopen(&files, 1, "/dev/null", O_WRONLY, 0);
    posix_spawn_file_actions_adddup2(&files, report, kProbeReport);
    posix_spawn_file_actions_addclosefrom_np(&files, kProbeReport + 1);
    posix_spawnattr_t attributes;
    posix_spawnattr_init(&attributes);
    posix_spawnattr_setflags(
        &attributes, POSIX_SPAWN_SETPGROUP | POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF);
    sigset_t signals;
    sigemptyset(&signals);
    posix_spawnattr_setsigmask(&attributes, &signals);
    sigfillset(&signals);
    posix_spawnattr_setsigdefault(&attributes, &signals);
    char* arguments[] = {program.data(), const_cast<char*>(library.c_str()), nullptr};
    const int error = posix_spawnp(&pid_, program.c_str(), &files, &attributes, arguments, environ);
    posix_spawnattr_destroy(&attributes);
    posix_spawn_file_actions_destroy(&files);
    return error;
  }

  int report_ = -1;
  pid_t pid_ = -1;
};

}  // namespace

LibraryCopy::LibraryCopy(const std::string& file) : file_(file), path_(file) {
  const fs::path original(file);
  std::string copy =
      (original.parent_path() / ("." + original.filename().string() + ".XXXXXX")).string();
  const int descriptor = mkostemp(copy.data(), O_CLOEXEC);
  if (descriptor < 0) return;
  close(descriptor);
  std::error_code error;
  if (fs::copy_file(original, copy, fs::copy_options::overwrite_existing, error)) {
    path_ = copy;
  } else {
    fs::remove(copy, error);
  }
}

LibraryCopy::~LibraryCopy() {
  std::error_code error;
  if (path_ != file_) fs::remove(path_, error);
}

void LibraryCopy::check() const {
  if (const std::string clause = coglab_rt::cutShort(path_); !clause.empty()) refuse(file_, clause);
  probe();
}

void LibraryCopy::probe() const {
  const auto deadline = steady_clock::now() + kProbeTime;
  const Probe probe(path_);
  std::string line = probe.lastLine(deadline);
  if (line == kProbeDone) return;
  for (std::size_t at; (at = line.find(path_)) != std::string::npos && path_ != file_;) {
    line.replace(at, path_.size(), file_);
  }
  const std::string error = kProbeError;
  if (line.compare(0, error.size(), error) == 0) refuse(file_, line.substr(error.size()));
  refuse(file_, probe.end(deadline) + " " + line + "; it was tried in a process of its own");
}

}  // namespace ctrl_more

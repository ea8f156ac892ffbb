// Counts the system calls of one thread between two points, without a tracer: Linux' syscall user
// dispatch raises SIGSYS for each, the handler counts it and lets it pass.
#pragma once

#include <atomic>
#include <csignal>
#include <cstdint>

#include <sys/prctl.h>
#include <sys/syscall.h>
#include <ucontext.h>

namespace coglab_controllers {

/// Of the thread that called enable(). At most one call is counted per start(): after the first one
/// the thread runs free.
class SystemCalls {
 public:
  /// False where the kernel (older than 5.11) or the processor does not offer it.
  static bool enable() {
#if defined(__x86_64__)
    struct sigaction action = {};
    action.sa_sigaction = onCall;
    action.sa_flags = SA_SIGINFO;
    sigemptyset(&action.sa_mask);
    if (sigaction(SIGSYS, &action, nullptr) != 0) return false;
    constexpr int kSetUserDispatch = 59, kOn = 1;  // <linux/prctl.h> of newer headers names them
    return prctl(kSetUserDispatch, kOn, 0UL, 0UL, &selector_) == 0;
#else
    return false;
#endif
  }
  static void start() { selector_ = kBlock; }
  static void stop() { selector_ = kAllow; }
  static std::uint64_t count() { return count_; }
  static int last() { return last_; }  ///< number of the last one seen

 private:
  static constexpr char kAllow = 0, kBlock = 1;

#if defined(__x86_64__)
  static void onCall(int, siginfo_t* info, void* context) {
    selector_ = kAllow;
    ++count_;
    last_ = info->si_syscall;
    // Back onto the instruction, which is two bytes long: the call is made after all.
    static_cast<ucontext_t*>(context)->uc_mcontext.gregs[REG_RIP] -= 2;
  }
#endif

  static inline volatile char selector_ = kAllow;
  static inline std::atomic<std::uint64_t> count_{0};
  static inline std::atomic<int> last_{-1};
};

}  // namespace coglab_controllers

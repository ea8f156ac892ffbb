/// @file
/// Requests of the PC to the KRL program on the robot controller: enter or leave command mode.
///
/// FRI has no such request. The PC can only write `$FRI_FRM_INT/REA/BOOL` and read
/// `$FRI_TO_INT/REA/BOOL`. The KRL program of each lab gives them another meaning. This file lists
/// the supported conventions. Indices in comments are 1-based as in KRL; on the wire they are one
/// lower. A request is a level: it stays until the phase changes.
///
// clang-format off
/// | convention      | start (strategy s = 10, 20, 30)   | stop              | the program shows       |
/// | --------------- | --------------------------------- | ----------------- | ----------------------- |
/// | coglab          | INT[1]=1, INT[2]=s, INT[3]=number | INT[1]=2, INT[3]  | INT[1..3], INT[16]=4010 |
/// | centro_epiaggio | INT[2]=1, INT[1]=s                | INT[2]=0          | INT[2]: 10, 1 on, 0 off |
/// | stanford        | INT[16]=10, INT[15]=s             | INT[16]=20        | INT[16]: 10 MON, 20 CMD |
/// | rcprg_tum       | INT[1]=1, BOOL[1] (s is 30)       | INT[1]=2, BOOL[1] | BOOL[1]: working on it  |
/// | rtt_lwr         | INT[1]=1, INT[2]=s, INT[3]=tool   | INT[1]=2          | INT[1]: FRI state       |
/// | openkc          | INT[16]=9, 6 or 7; then INT[16]=1 | INT[16]=2         | INT[15], BOOL[1]        |
// clang-format on
///
/// openkc executes one command after the other, each with BOOL[1]. A command is finished when the
/// program shows it in TO_INT[15] and sets TO_BOOL[1] (TO_INT[14] counts commands). The PC then
/// clears BOOL[1] and waits until the program clears TO_BOOL[1]. Commands: 9 position, 6 Cartesian,
/// 7 joint impedance, 1 friStart, 2 friStop. Source: public clients and emulators of that program.
///
/// Our own program (krl/coglab_fri.src) acts once per request number (1..32767, wraps to 1) and
/// answers with
///   TO_INT[1] number of the last finished request, TO_INT[2] its result (KrlResult),
///   TO_INT[3] number of the current request (0: none), TO_INT[16] = 4010, so that the PC
///   recognises the program.
#pragma once

#include <string>

#include "lwr_fri_bridge/fri/datagram.hpp"

namespace lwr_fri_bridge::fri {

enum class KrlConvention : std::uint8_t {
  Coglab,
  CentroEpiaggio,
  Stanford,
  RcprgTum,
  RttLwr,
  OpenKc
};

/// Current request of the PC to the KRL program.
enum class KrlPhase : std::uint8_t {
  Idle,     ///< monitor mode, no request
  Start,    ///< enter command mode
  Running,  ///< command mode reached, no request
  Stop      ///< go to monitor mode
};

/// Results of our own KRL program in TO_INT[2].
enum class KrlResult : std::int32_t {
  None = 0,             ///< no request finished yet
  Done = 1,             ///< the controller is in the requested mode
  UnknownRequest = -1,  ///< the program does not know the request or strategy
  PoorQuality = -2,     ///< the quality of the connection did not become good in time
  NotEntered = -3,      ///< `friStart` did not lead to command mode
  NoDrives = -4         ///< drives or brakes could not be switched on
};

constexpr std::int32_t kCoglabProgramMark = 4010;  ///< TO_INT[16] of our own program
constexpr std::uint16_t kMaxRequestNumber = 32767;

/// A phase with its parameters.
struct KrlRequest {
  KrlPhase phase = KrlPhase::Idle;
  ControlStrategy strategy = ControlStrategy::Position;  ///< for Start
  std::uint16_t number = 0;       ///< increases with every Start and Stop; coglab only
  std::int32_t tool = 0;          ///< tool number; rtt_lwr only
  std::uint8_t acknowledged = 0;  ///< finished commands of this phase; openkc only
  bool asserted = false;          ///< the next command is requested; openkc only
};

/// Reply of the KRL program to a request.
struct KrlReply {
  bool known = true;     ///< false: no mark of this convention is visible (coglab only)
  bool busy = false;     ///< the program works on the request
  bool refused = false;  ///< the program refuses the request
  KrlResult result = KrlResult::None;  ///< reason of a refusal (coglab only)
};

/// Writes the request into the fields of the convention. Other fields stay unchanged. Real-time
/// safe.
void writeRequest(KrlConvention convention, const KrlRequest& request, UserData& to_controller);

/// Continues with the next command of a phase after the program has acknowledged the previous one.
/// Call it once per measurement. Only openkc has phases of several commands. Real-time safe.
void stepRequest(KrlConvention convention, KrlRequest& request, const UserData& from_controller);

/// Reads the program's reply to `request`. Real-time safe.
KrlReply readReply(KrlConvention convention, const KrlRequest& request,
                   const UserData& from_controller);

/// Number of the last request that our own program finished (TO_INT[1]). A new request needs
/// another number.
inline std::int32_t lastFinished(const MeasurementDatagram& measurement) {
  return measurement.krl.ints[0];
}

/// True if the convention's program can run this strategy (rcprg_tum: only joint impedance).
bool supports(KrlConvention convention, ControlStrategy strategy);

/// "coglab", "centro_epiaggio", "stanford", "rcprg_tum", "rtt_lwr", "openkc".
const char* nameOf(KrlConvention convention);

/// Inverse of nameOf(). @throws std::invalid_argument with the known names.
KrlConvention krlConventionFromName(const std::string& name);

}  // namespace lwr_fri_bridge::fri

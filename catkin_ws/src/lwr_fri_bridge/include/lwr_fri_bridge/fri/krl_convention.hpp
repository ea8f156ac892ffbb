/// @file
/// How a PC asks the KRL program on the robot controller to enter or leave command mode.
///
/// FRI itself has no such request: the PC can only write `$FRI_FRM_INT/REA/BOOL` and read
/// `$FRI_TO_INT/REA/BOOL`, and every lab's KRL program gives them its own meaning. This file is the
/// table of the meanings we speak. Indices in comments are KRL's, 1-based; on the wire they are one
/// lower. Requests are levels: they stay until the phase changes.
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
/// openkc takes one command after the other, each with BOOL[1]: it is over when the program shows
/// the command in TO_INT[15] and sets TO_BOOL[1] (TO_INT[14] counts them); the PC then takes
/// BOOL[1] back and waits for the program to do so too. Commands: 9 position, 6 Cartesian, 7 joint
/// impedance, 1 friStart, 2 friStop. Source: public clients and emulators of that program.
///
/// Our own program (krl/coglab_fri.src) acts once per request number (1..32767, wraps to 1) and
/// answers with
///   TO_INT[1] number of the request finished last, TO_INT[2] its result (KrlResult),
///   TO_INT[3] number of the request it works on (0: none), TO_INT[16] = 4010, so that the PC knows
///   whom it talks to.
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

/// What the PC wants from the KRL program at the moment.
enum class KrlPhase : std::uint8_t {
  Idle,     ///< monitor mode, nothing asked
  Start,    ///< enter command mode
  Running,  ///< command mode reached; nothing more asked
  Stop      ///< go to monitor mode
};

/// Results of our own KRL program in TO_INT[2].
enum class KrlResult : std::int32_t {
  None = 0,             ///< no request finished yet
  Done = 1,             ///< the controller is in the mode that was asked for
  UnknownRequest = -1,  ///< request or strategy is not one the program knows
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
  std::uint16_t number = 0;       ///< grows with every Start and Stop; coglab only
  std::int32_t tool = 0;          ///< tool number; rtt_lwr only
  std::uint8_t acknowledged = 0;  ///< commands of this phase that are over; openkc only
  bool asserted = false;          ///< the next one is asked for; openkc only
};

/// What the KRL program says about a request.
struct KrlReply {
  bool known = true;     ///< false: the program shows none of this convention's marks (coglab only)
  bool busy = false;     ///< it works on the request
  bool refused = false;  ///< it will not fulfil the request
  KrlResult result = KrlResult::None;  ///< why refused (coglab only)
};

/// Writes the request into the fields the convention uses and leaves the other fields alone.
/// Real-time safe.
void writeRequest(KrlConvention convention, const KrlRequest& request, UserData& to_controller);

/// Once per measurement: goes on to the next command of a phase that takes several, when the
/// program has acknowledged the one before. Only openkc needs it. Real-time safe.
void stepRequest(KrlConvention convention, KrlRequest& request, const UserData& from_controller);

/// Reads what the program says about `request`. Real-time safe.
KrlReply readReply(KrlConvention convention, const KrlRequest& request,
                   const UserData& from_controller);

/// Number of the request that our own program finished last (TO_INT[1]): a new request needs
/// another.
inline std::int32_t lastFinished(const MeasurementDatagram& measurement) {
  return measurement.krl.ints[0];
}

/// Whether the convention's program can run this strategy (rcprg_tum fixes joint impedance).
bool supports(KrlConvention convention, ControlStrategy strategy);

/// "coglab", "centro_epiaggio", "stanford", "rcprg_tum", "rtt_lwr", "openkc".
const char* nameOf(KrlConvention convention);

/// Inverse of nameOf(). @throws std::invalid_argument listing the known names.
KrlConvention krlConventionFromName(const std::string& name);

}  // namespace lwr_fri_bridge::fri

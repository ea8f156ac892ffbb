/// @file
/// The programs that run on the controller and start and stop FRI on the PC's request.
///
/// KRL indices count from 1. TO = controller to PC, FRM = PC to controller. Existing PC stacks
/// bring their own program; each convention here answers the same requests at the same array places
/// as that stack's script.
#pragma once

#include <memory>
#include <string>

#include "coglab_sim/krc/parameters.hpp"
#include "lwr_fri_bridge/fri/datagram.hpp"

namespace coglab_sim::krc {

/// What a KRL program can see and do.
class KrlInterface {
 public:
  virtual ~KrlInterface() = default;

  virtual std::int32_t frmInt(int index) const = 0;  ///< `$FRI_FRM_INT[index]`, index 1..16
  virtual float frmReal(int index) const = 0;
  virtual bool frmBool(int index) const = 0;
  virtual void setToInt(int index, std::int32_t value) = 0;  ///< `$FRI_TO_INT[index]`
  virtual void setToReal(int index, float value) = 0;
  virtual void setToBool(int index, bool value) = 0;

  virtual lwr_fri_bridge::fri::FriState state() const = 0;
  virtual lwr_fri_bridge::fri::Quality quality() const = 0;
  virtual int krlStrategy() const = 0;  ///< `$STIFFNESS.STRATEGY`: 10, 20 or 30
  virtual bool setKrlStrategy(
      int strategy) = 0;  ///< false, with a message, if unknown or not in monitor mode
  /// Defaults of $STIFFNESS, for values that the PC does not give: Nm/rad, N/m; damping normalised.
  virtual void setJointImpedance(const Vector7& stiffness, const Vector7& damping) = 0;
  virtual void setCartesianImpedance(const Vector6& stiffness, const Vector6& damping) = 0;
  virtual bool drivesReady() const = 0;  ///< power on all joints and brakes open

  virtual void friOpen(double period) = 0;  ///< OFF -> MON; a period <= 0 keeps the present one
  virtual lwr_fri_bridge::fri::FriState friStart(
      double scale) = 0;  ///< tries MON -> CMD, returns the state then
  virtual void friStop() = 0;
  virtual void friClose() = 0;
  /// Acknowledges messages if the program may, and starts the tiny motion that opens the brakes;
  /// see drivesReady().
  virtual void nudge() = 0;
  virtual void show(const std::string& message) = 0;
  virtual const Parameters& parameters() const = 0;
};

/// One of the programs. `poll()` runs until the program's next WAIT and returns how long that is,
/// s.
class KrlProgram {
 public:
  virtual ~KrlProgram() = default;
  virtual double poll(KrlInterface& krl) = 0;
};

/// The program for a convention.
std::unique_ptr<KrlProgram> makeKrlProgram(KrlConvention convention);

/// @throws std::invalid_argument naming the known conventions.
KrlConvention krlConventionOf(const std::string& name);
/// coglab, centro_epiaggio, stanford, rcprg_tum, rtt_lwr, openkc, kuka_sample
std::string nameOf(KrlConvention convention);

}  // namespace coglab_sim::krc

/// @file
/// KRL programs of the controller. They start and stop FRI when the PC requests it.
///
/// KRL indices count from 1. TO = controller to PC, FRM = PC to controller. Each existing PC stack
/// has its own program. A convention here answers the same requests at the same array indices as
/// the script of that stack.
#pragma once

#include <memory>
#include <string>

#include "coglab_sim/krc/parameters.hpp"
#include "lwr_fri_bridge/fri/datagram.hpp"

namespace coglab_sim::krc {

/// Interface of a KRL program to the controller.
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
      int strategy) = 0;  ///< false, with a message, if unknown or outside monitor mode
  /// Sets the defaults of $STIFFNESS, used where the PC gives no value: Nm/rad, N/m; damping is
  /// normalised.
  virtual void setJointImpedance(const Vector7& stiffness, const Vector7& damping) = 0;
  virtual void setCartesianImpedance(const Vector6& stiffness, const Vector6& damping) = 0;
  virtual bool drivesReady() const = 0;  ///< power on all joints and brakes open

  virtual void friOpen(double period) = 0;  ///< OFF -> MON; a period <= 0 keeps the present one
  virtual lwr_fri_bridge::fri::FriState friStart(
      double scale) = 0;  ///< tries MON -> CMD, returns the new state
  virtual void friStop() = 0;
  virtual void friClose() = 0;
  /// Acknowledges messages if the program is allowed to, and starts the small motion that opens the
  /// brakes; see drivesReady().
  virtual void nudge() = 0;
  virtual void show(const std::string& message) = 0;
  virtual const Parameters& parameters() const = 0;
};

/// One KRL program. `poll()` runs until the next WAIT and returns its duration, s.
class KrlProgram {
 public:
  virtual ~KrlProgram() = default;
  virtual double poll(KrlInterface& krl) = 0;
};

/// Creates the program of a convention.
std::unique_ptr<KrlProgram> makeKrlProgram(KrlConvention convention);

/// @throws std::invalid_argument naming the known conventions.
KrlConvention krlConventionOf(const std::string& name);
/// coglab, centro_epiaggio, stanford, rcprg_tum, rtt_lwr, openkc, kuka_sample
std::string nameOf(KrlConvention convention);

}  // namespace coglab_sim::krc

/// @file
/// Every figure of the robot controller's behaviour that the stand-in has to choose.
///
/// "published" marks what a public source states; all others are OUR CHOICE, because no public
/// document settles them. This struct is the only table of them; docs and the node's parameters are
/// generated from the same names.
#pragma once

#include "coglab_sim/geometry.hpp"

namespace coglab_sim::krc {

/// Operating modes of a KRC that matter here.
enum class OperatingMode { T1, T2, Automatic };

/// Which KRL program runs on the controller, i.e. how PC and program talk through the exchange
/// arrays.
enum class KrlConvention { Coglab, CentroEpiaggio, Stanford, RcprgTum, RttLwr, OpenKc, KukaSample };

/// @see the file's comment. Times in s, angles in rad.
struct Parameters {
  double period = 0.005;  ///< FRI period; its range in ranges.cpp is published
  OperatingMode mode = OperatingMode::Automatic;
  KrlConvention convention = KrlConvention::Coglab;

  // Quality: share of the last 100 packets (published window) answered in time. Thresholds ours.
  double quality_perfect = 0.99;
  double quality_ok = 0.95;
  double quality_bad = 0.80;
  int entry_quality = 2;  ///< lowest Quality that lets `friStart` succeed (OK)

  // Timing of answers.
  int extrapolated_packets =
      5;  ///< consecutive losses bridged by extrapolation in command mode; one more ends it

  // Entry into command mode.
  double entry_position_tolerance = 1e-4;  ///< rad per joint between command and set-point
  double entry_frame_tolerance = 1e-3;     ///< m, and rad for the orientation
  double torque_tolerance =
      1.0;  ///< Nm; added torque on entry, and its largest step (users' reports: about 1)

  // Cyclic checks. Speeds are published (rsidef7.dat as quoted by TUM), 120 120 160 160 250 220 220
  // deg/s.
  Vector7 speed_limit =
      (Vector7() << 2.0943951, 2.0943951, 2.7925268, 2.7925268, 4.3633231, 3.8397244, 3.8397244)
          .finished();
  double t1_speed_limit = 0.24;        ///< rad/s in T1 (CentroEPiaggio)
  double speed_margin = 0.05;          ///< share by which a step may exceed limit x period
  double frame_speed_limit = 2.0;      ///< m/s of a commanded frame
  double frame_turn_limit = 4.0;       ///< rad/s of a commanded frame
  double frame_orthonormality = 1e-3;  ///< by which a commanded rotation matrix may fail to be one
  /// rad, +-; mechanical range (published).
  Vector7 position_limit =
      (Vector7() << 2.96705973, 2.0943951, 2.96705973, 2.0943951, 2.96705973, 2.0943951, 2.96705973)
          .finished();
  double torque_limit_time =
      0.05;  ///< s that a motor may give its full torque before the drives are switched off
  double joint_stiffness_max = 5000.0;   ///< Nm/rad
  double frame_stiffness_max = 10000.0;  ///< N/m; rotations 1000 Nm/rad
  double rotation_stiffness_max = 1000.0;

  // Defaults of $STIFFNESS (published as used by clients: ISIR, Stanford).
  double joint_stiffness = 1000.0;
  double frame_stiffness = 2000.0;
  double rotation_stiffness = 200.0;
  double damping = 0.7;

  // KRL and drives.
  double krl_poll =
      0.05;  ///< s between two looks of the KRL program at the exchange arrays (published: ~50 ms)
  double krl_message_wait =
      0.3;                      ///< s a program waits when it shows a message (published: 0.3-0.5)
  double krl_drive_wait = 3.0;  ///< s a program waits for drives and brakes before it gives up
  double krl_quality_wait = 12.0;  ///< s it waits for the quality; 100 packets of 100 ms take 10 s
  double brake_release = 0.3;      ///< s that the tiny motion takes which opens the brakes
  double power_up = 0.5;           ///< s from acknowledging an error to full drive power
  double close_linger = 1.5;  ///< s that measurements go on after friClose; clients wait for them
  bool acknowledge_by_program = true;  ///< false: errors wait for an operator (`acknowledge()`)
  double ambient_temperature = 25.0;   ///< degree Celsius
  double drive_heating = 20.0;         ///< K above that at full torque, in the end
  double drive_heating_time = 600.0;   ///< s, time constant of it
  double drive_warning = 70.0;         ///< degree Celsius from which a drive warns
};

}  // namespace coglab_sim::krc

/// @file
/// What the stand-in has to choose about the robot controller's behaviour.
#pragma once

#include "coglab_sim/geometry.hpp"

namespace coglab_sim::krc {

/// Operating modes of a KRC that matter here.
enum class OperatingMode { T1, T2, Automatic };

/// Which KRL program runs on the controller, i.e. how PC and program talk through the exchange
/// arrays.
enum class KrlConvention { Coglab, CentroEpiaggio, Stanford, RcprgTum, RttLwr, OpenKc, KukaSample };

/// Defaults, units and texts are in parameter_table.inc.
struct Parameters {
#define KRC(type, field, value, ...) type field = value;
#include "coglab_sim/parameter_table.inc"
};

}  // namespace coglab_sim::krc

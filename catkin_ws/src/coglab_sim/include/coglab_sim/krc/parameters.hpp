/// @file
/// Parameters of the simulated robot controller.
#pragma once

#include "coglab_sim/geometry.hpp"

namespace coglab_sim::krc {

/// Simulated operating modes of the KRC.
enum class OperatingMode { T1, T2, Automatic };

/// KRL program on the controller. It defines the meaning of the exchange arrays between PC and
/// controller.
enum class KrlConvention { Coglab, CentroEpiaggio, Stanford, RcprgTum, RttLwr, OpenKc, KukaSample };

/// Defaults, units and texts are in parameter_table.inc.
struct Parameters {
#define KRC(type, field, value, ...) type field = value;
#include "coglab_sim/parameter_table.inc"
};

}  // namespace coglab_sim::krc

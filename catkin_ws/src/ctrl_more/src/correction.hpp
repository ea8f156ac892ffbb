#pragma once

#include "ctrl_more/signal.hpp"

namespace ctrl_more {

/// Corrections of one signal, as plain doubles of the signal's size: a vector holds the sum, a
/// pose holds position sum and left quaternion factor, a quaternion holds the left factor.
namespace correction {

/// No correction.
void setIdentity(SignalKind kind, int size, double* c);

/// The correction that leads from `before` to `after`.
void difference(SignalKind kind, int size, const double* before, const double* after, double* c);

/// `out` = `before` with a correction applied; `out` may be `before`.
void apply(SignalKind kind, int size, const double* before, const double* c, double* out);

/// `out` between two corrections, `share` in [0, 1] on the shorter way; may alias either.
void between(SignalKind kind, int size, const double* from, const double* to, double share,
             double* out);

/// Norm of a correction: of the sum (of the position for poses), and angle of its rotation [rad].
struct Norms {
  double size = 0.0;
  double angle = 0.0;
};
Norms norms(SignalKind kind, int size, const double* c);

/// True if every number is finite.
bool isFinite(int size, const double* values);

/// True if the quaternion in the signal, if it has one, is unit within 1e-6.
bool isUnit(SignalKind kind, int size, const double* values);

}  // namespace correction
}  // namespace ctrl_more

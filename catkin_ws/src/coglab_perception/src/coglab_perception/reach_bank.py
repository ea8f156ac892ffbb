"""Estimates whether a hand moves to a handover and where it will rest: a bank of motion hypotheses over observations.

Bayesian on-line change-point detection (Adams and MacKay 2007) with minimum-jerk motions. At each observation new
motions may have begun, with each duration of a grid, toward a handover or toward any other place. Each hypothesis is a
Kalman filter per axis. Its state is position, velocity, acceleration, end of the motion and the slowly varying error of
the tracker. Its weight is the likelihood of all observations. A completed motion is rest, at a handover or elsewhere.

The bank is compiled (coglab_perception/src/reach_bank.cpp); its settings are here.
"""

from __future__ import annotations

from dataclasses import dataclass

from ._reach_bank import Prediction, ReachBank

__all__ = ["Prediction", "ReachBank", "ReachSettings"]


@dataclass(frozen=True)
class ReachSettings:
    """Prior knowledge about the hand. Lengths in m, times in s, rates in 1/s."""

    place: tuple[float, float, float] = (0.86, 0.0, 0.44)
    """mean place of a person's hand at a handover, world axes"""
    place_deviation: tuple[float, float, float] = (0.06, 0.08, 0.08)
    """standard deviation of this place per axis"""
    handover_rate: float = 0.2
    """rate of motions from rest toward a handover"""
    other_rate: float = 0.7
    """rate of all other motions"""
    reach_time: float = 1.2
    """median duration of a motion toward a handover"""
    reach_time_deviation: float = 0.25
    """standard deviation of its logarithm"""
    reach_times: tuple[float, ...] = (0.7, 0.85, 1.0, 1.2, 1.4, 1.7, 2.1, 2.6)
    """s, grid of durations"""
    small_times: tuple[float, ...] = (0.25, 0.4, 0.6, 0.9)
    """the same for small other motions"""
    wide_times: tuple[float, ...] = (0.5, 0.7, 0.9, 1.2, 1.6)
    """the same for wide other motions"""
    small_way: float = 0.06
    """standard deviation per axis of the displacements of small other motions, which are as likely as wide ones"""
    wide_way: float = 0.30
    """the same of wide other motions"""
    return_rate: float = 1.0
    """rate of motions back to the usual rest, from a place more than 2 return_way away from it"""
    return_way: float = 0.06
    """standard deviation per axis of their ends"""
    home_time: float = 4.0
    """averaging time of the place of the hand's usual rest"""
    correction_rate: float = 0.1
    """rate of changes of a motion's end during the motion, and of displacements of a hand at a handover"""
    correction_times: tuple[float, ...] = (0.45, 0.7, 1.1)
    """grid of durations of these changes"""
    correction_way: float = 0.10
    """standard deviation per axis of these changes"""
    vertical_shares: tuple[float, ...] = (0.82, 0.95)
    """shares of a reach's duration after which its vertical part is complete (decoupled minimum jerk, Huber et al.
    2009). Both are equally likely; other motions have the last one"""
    noise: float = 0.004
    """standard deviation of the tracker's error per axis"""
    noise_time: float = 0.5
    """correlation time of this error"""
    rest_wander: float = 0.004
    """random walk of a hand at rest, m per square root of s"""
    acceleration_wander: float = 0.8
    """random walk of the acceleration about minimum jerk, m/s^2 per square root of s"""
    end_wander: float = 0.02
    """random walk of the end of a motion, m per square root of s"""
    clutter_density: float = 10.0
    """1/m^3, probability density of an observation of something else. An observation with a lower density is ignored"""
    clutter_again: float = 1e4
    """the same density after such an observation: a tracker that confuses the hand with something else repeats it"""
    hypotheses: int = 150
    """largest number of hypotheses"""

/// Python module coglab_perception._reach_bank: the bank of reaches, and the motion that it
/// assumes.
#include "coglab_perception/reach_bank.hpp"

#include <pybind11/eigen.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <cmath>
#include <stdexcept>

#include "coglab_perception/minimum_jerk.hpp"

namespace py = pybind11;
using namespace coglab_perception;

namespace {

std::vector<double> listOf(const py::object& settings, const char* name) {
  auto values = settings.attr(name).cast<std::vector<double>>();
  if (values.empty())
    throw std::invalid_argument(std::string(name) + ": expected numbers, got none");
  return values;
}

/// The settings of Python by their names.
ReachSettings settingsFrom(const py::object& settings) {
  const auto number = [&](const char* name) { return settings.attr(name).cast<double>(); };
  const auto vector = [&](const char* name) { return settings.attr(name).cast<Vector3d>(); };
  ReachSettings s;
  s.place = vector("place");
  s.place_deviation = vector("place_deviation");
  s.handover_rate = number("handover_rate");
  s.other_rate = number("other_rate");
  s.reach_time = number("reach_time");
  s.reach_time_deviation = number("reach_time_deviation");
  s.reach_times = listOf(settings, "reach_times");
  s.small_times = listOf(settings, "small_times");
  s.wide_times = listOf(settings, "wide_times");
  s.small_way = number("small_way");
  s.wide_way = number("wide_way");
  s.return_rate = number("return_rate");
  s.return_way = number("return_way");
  s.home_time = number("home_time");
  s.correction_rate = number("correction_rate");
  s.correction_times = listOf(settings, "correction_times");
  s.correction_way = number("correction_way");
  s.vertical_shares = listOf(settings, "vertical_shares");
  s.noise = number("noise");
  s.noise_time = number("noise_time");
  s.rest_wander = number("rest_wander");
  s.acceleration_wander = number("acceleration_wander");
  s.end_wander = number("end_wander");
  s.clutter_density = number("clutter_density");
  s.clutter_again = number("clutter_again");
  const double most = number("hypotheses");
  if (!(most >= 1.0 && most <= 1e5))
    throw std::invalid_argument("hypotheses: expected 1 to 100000, got " + std::to_string(most));
  s.hypotheses = static_cast<std::size_t>(most);
  return s;
}

void checkSight(double stamp, const Vector3d& position) {
  if (!std::isfinite(stamp) || !position.allFinite())
    throw std::invalid_argument("a sight of the hand has a finite stamp (s) and position (m)");
}

}  // namespace

PYBIND11_MODULE(_reach_bank, m) {
  m.doc() = "The bank of reaches, see reach_bank. SI units, world axes.";

  py::class_<Prediction>(
      m, "Prediction", "Where and when the hand comes to rest, from the motions toward a handover.")
      .def_property_readonly(
          "end", [](const Prediction& p) { return Vector3d(p.end); }, "m (3,)")
      .def_property_readonly(
          "covariance", [](const Prediction& p) { return Matrix3d(p.covariance); },
          "m^2 (3, 3), of the end")
      .def_readonly("arrival", &Prediction::arrival, "s, stamp")
      .def_readonly("arrival_deviation", &Prediction::arrival_deviation, "s")
      .def_readonly("onset", &Prediction::onset, "s, stamp at which the motion began");

  py::class_<ReachBank>(
      m, "ReachBank",
      "Hypotheses for one hand. Call step() with each observation, in the order of "
      "stamps.")
      .def(py::init([](double stamp, const Vector3d& position, const py::object& settings) {
             checkSight(stamp, position);
             return ReachBank(stamp, position, settingsFrom(settings));
           }),
           py::arg("stamp"), py::arg("position"), py::arg("settings"),
           "Begins with a hand seen at `position` (m) at `stamp` (s); settings: a "
           "reach_bank.ReachSettings.")
      .def(
          "step",
          [](ReachBank& bank, double stamp, const Vector3d& position) {
            checkSight(stamp, position);
            return bank.step(stamp, position);
          },
          py::arg("stamp"), py::arg("position"),
          "Processes an observation. False if it does not show this hand or is impossible for a "
          "hand; then only the prediction to the stamp is done.")
      .def("forget", &ReachBank::forget,
           "Counts every motion toward a handover as another motion from now on.")
      .def("position", &ReachBank::position,
           "Expected current position (m), without the tracker's error.")
      .def("velocity", &ReachBank::velocity, "Expected current velocity (m/s).")
      .def("prediction", &ReachBank::prediction,
           "Prediction of the handover; None if no hypothesis of a motion toward one is left.")
      .def_property_readonly("handover", &ReachBank::handover,
                             "Probability that the hand moves toward a handover or waits at one.")
      .def_property_readonly("stamp", &ReachBank::stamp, "s, of the newest observation.")
      .def("__len__", &ReachBank::size, "Number of hypotheses.");

  m.def("transition", &transition, py::arg("remaining"), py::arg("step"),
        "(3, 4): position, velocity and acceleration (m, m/s, m/s^2) after `step` s of a "
        "minimum-jerk motion, from position, velocity, acceleration and end (m), `remaining` s "
        "before the end. A motion that ends within the step rests at its end. A step <= 0 changes "
        "nothing.");
}

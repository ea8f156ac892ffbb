// The hand moves along one circle in the plane perpendicular to its pointing direction.
#include <cmath>

#include "coglab_controllers/motion/custom_motion_controller.hpp"

namespace {

using namespace coglab_controllers;

class Circle : public Motion<> {
 public:
  void configure(MotionConfiguration& configuration) override {
    radius_ = configuration.argument("radius", "m", 0.05, 0.0, 0.15);
    duration_ = configuration.argument("duration", "s", 6.0, 2.0, 60.0);
  }

  void start(const MotionStart<>& start) override {
    from_ = start.from.pose;
    r_ = start.request[radius_];
    all_ = start.request[duration_];
    time_ = 0.0;
  }

  void computeReference(const MotionCycle& cycle, MotionReference& reference) override {
    reference.pose(at(cycle.time), at(cycle.next));
    time_ = cycle.next;
  }

  MotionState state() const override {
    return time_ >= all_ ? MotionState::Reached : MotionState::Running;
  }

 private:
  Pose at(double time) const {
    const double u = std::min(time / all_, 1.0);
    const double turned =
        2.0 * M_PI * u * u * u * (10.0 - 15.0 * u + 6.0 * u * u);  // from rest to rest
    const Vector3 way(0.0, r_ * std::sin(turned), r_ * (1.0 - std::cos(turned)));
    return {from_.position + from_.orientation * way, from_.orientation};
  }

  ArgumentIndex radius_, duration_;
  Pose from_;
  double r_ = 0.0, all_ = 1.0, time_ = 0.0;
};

}  // namespace

COGLAB_REGISTER_MOTION("coglab_example_motions/Circle", Circle)

// A library with a manager that moves the centre of mass.
#include <stdexcept>

#include "ctrl_more/central_module.hpp"

namespace {

using namespace ctrl_more;

class Walk : public Manager {
 public:
  Walk(const std::string& name, const ConfigNode& block, RobotStates&, ControlStates&, Logger*)
      : name_(name) {
    if (!block.find("step")) throw std::runtime_error("it needs a step");
    step_ = block.find("step")->number("step");
  }
  const std::string& name() const override { return name_; }
  void beginCycle(const Cycle&) noexcept override {}
  void updateStage(Stage stage, const RobotStates&, ControlStates& control) noexcept override {
    if (stage == Stage::Task) control.setCoM(control.getCoM() + Eigen::Vector3d(step_, 0.0, 0.0));
  }

 private:
  std::string name_;
  double step_ = 0.0;
};

}  // namespace

CTRL_MORE_REGISTER_MANAGER(Walk, "Walk")

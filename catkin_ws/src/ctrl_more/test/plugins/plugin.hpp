#pragma once

#include "ctrl_more/feedback_controller.hpp"

namespace ctrl_more_test {

/// A minimal plug-in.
class Plugin : public ctrl_more::FeedbackController {
 public:
  explicit Plugin(std::string type) : type_(std::move(type)) {}
  ctrl_more::Description describe() const override {
    ctrl_more::Description d;
    d.type = type_;
    d.modifies(ctrl_more::ControlContainer::Zmp, "zmp").in("m").frameOf("world").about("shifted");
    return d;
  }
  void initialize(ctrl_more::Setup& setup) override { zmp_ = setup.modify<3>("zmp"); }
  void update(const ctrl_more::Cycle&, const ctrl_more::RobotStates&,
              const ctrl_more::ControlStates&,
              ctrl_more::ModifiedControlStates& modified) override {
    modified[zmp_][0] += 1.0;
  }

 private:
  std::string type_;
  ctrl_more::Modify<3> zmp_;
};

}  // namespace ctrl_more_test

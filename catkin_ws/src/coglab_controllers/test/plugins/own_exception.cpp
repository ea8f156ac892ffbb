// A motion controller whose configure() throws an exception of a class that only this library has.
#include <exception>
#include <string>

#include "coglab_controllers/manager/plugin_registry.hpp"

namespace {

using namespace coglab_controllers;

class OwnError : public std::exception {
 public:
  explicit OwnError(std::string what) : what_(std::move(what)) {}
  const char* what() const noexcept override { return what_.c_str(); }

 private:
  std::string what_;
};

class Throwing : public MotionController {
 public:
  void configure(const MotionSetup& setup) override {
    throw OwnError("told to fail with an error of its own, as '" + setup.id + "'");
  }
  void adopt(const CycleInput&) override {}
  void start(const CycleInput&) override {}
  void stop() override {}
  void abort(const Reason&) override {}
  void computeReference(const CycleInput&, References&) override {}
  void resolve(const CycleInput&, References&) override {}
  MotionState state() const override { return MotionState::Idle; }
  const Reason& reason() const override { return reason_; }

 private:
  Reason reason_;
};

}  // namespace

COGLAB_REGISTER_MOTION_CONTROLLER("test/Throwing", Throwing)

#include <exception>

#include "plugin.hpp"

// Controllers that throw an exception class of this library, at each place where a manager calls
// them before they run.
namespace {

// Its vtable, and so its text, is gone once the library is.
class OwnError : public std::exception {
 public:
  const char* what() const noexcept override { return "an error of its own"; }
};

struct OwnThing {
  OwnThing() = default;
  OwnThing(const OwnThing&) {}
  virtual ~OwnThing() {}
};

class Stranger : public ctrl_more_test::Plugin {
 public:
  using Plugin::Plugin;
};

class InDescribe : public Stranger {
 public:
  using Stranger::Stranger;
  ctrl_more::Description describe() const override { throw OwnError(); }
};

class InInitialize : public Stranger {
 public:
  using Stranger::Stranger;
  void initialize(ctrl_more::Setup& setup) override {
    Stranger::initialize(setup);
    throw OwnError();
  }
};

class ThingInInitialize : public Stranger {
 public:
  using Stranger::Stranger;
  void initialize(ctrl_more::Setup& setup) override {
    Stranger::initialize(setup);
    throw OwnThing();
  }
};

class InUpdate : public Stranger {
 public:
  using Stranger::Stranger;
  void update(const ctrl_more::Cycle&, const ctrl_more::RobotStates&,
              const ctrl_more::ControlStates&, ctrl_more::ModifiedControlStates&) override {
    throw OwnError();
  }
};

// Gains are judged whenever they change.
class InJudge : public Stranger {
 public:
  using Stranger::Stranger;
  ctrl_more::Description describe() const override {
    ctrl_more::Description d = Stranger::describe();
    d.gain("k", 1.0).in("1").about("accepted below 2");
    return d;
  }
  std::string judgeGains(const ctrl_more::GainValues& gains) const override {
    if (gains.scalar(gains.find("k")) >= 2.0) throw OwnError();
    return "";
  }
};

using ctrl_more::FeedbackController;
using ctrl_more::PrototypeRegistration;

FeedbackController* inMaker() { throw OwnError(); }
FeedbackController* numberInMaker() { throw 42; }
FeedbackController* thingInMaker() { throw OwnThing(); }
FeedbackController* inDescribe() { return new InDescribe("InDescribe"); }
FeedbackController* inInitialize() { return new InInitialize("InInitialize"); }
FeedbackController* thingInInitialize() { return new ThingInInitialize("ThingInInitialize"); }
FeedbackController* inUpdate() { return new InUpdate("InUpdate"); }
FeedbackController* inJudge() { return new InJudge("InJudge"); }

const PrototypeRegistration registrations[] = {
    {"InMaker", &inMaker},           {"NumberInMaker", &numberInMaker},
    {"ThingInMaker", &thingInMaker}, {"InDescribe", &inDescribe},
    {"InInitialize", &inInitialize}, {"ThingInInitialize", &thingInInitialize},
    {"InUpdate", &inUpdate},         {"InJudge", &inJudge},
};

}  // namespace

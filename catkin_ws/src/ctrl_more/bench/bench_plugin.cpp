// A plug-in that bench_feedback.py multiplies: the ten characters of its type name are replaced in
// copies of the built library. Registered with class_loader alone when BARE is defined, so that a
// bare class_loader loads the same code.
#include "ctrl_more/feedback_controller.hpp"
#ifdef BARE
#include <class_loader/register_macro.hpp>
#endif

// Not constant, so that the compiler reads it where the copies have it changed; hidden, so that
// each copy reads its own.
__attribute__((visibility("hidden"))) char bench_plugin_type[] = "BenchPlug#000";

namespace {

class BenchPlugin : public ctrl_more::FeedbackController {
 public:
  ctrl_more::Description describe() const override {
    ctrl_more::Description d;
    d.type = bench_plugin_type;
    d.modifies(ctrl_more::ControlContainer::Zmp, "zmp").in("m").frameOf("world").about("shifted");
    return d;
  }
  void initialize(ctrl_more::Setup& setup) override { zmp_ = setup.modify<3>("zmp"); }
  void update(const ctrl_more::Cycle&, const ctrl_more::RobotStates&,
              const ctrl_more::ControlStates&,
              ctrl_more::ModifiedControlStates& modified) override {
    modified[zmp_][0] += 1e-9;
  }

 private:
  ctrl_more::Modify<3> zmp_;
};

#ifdef BARE
struct Registration {
  Registration() {
    keep = class_loader::impl::registerPlugin<BenchPlugin, ctrl_more::FeedbackController>(
        bench_plugin_type, "ctrl_more::FeedbackController");
  }
  class_loader::impl::UniquePtr<class_loader::impl::AbstractMetaObjectBase> keep;
};
Registration registration;
#else
ctrl_more::FeedbackController* make() { return new BenchPlugin(); }
const ctrl_more::PrototypeRegistration registration(bench_plugin_type, &make);
#endif

}  // namespace

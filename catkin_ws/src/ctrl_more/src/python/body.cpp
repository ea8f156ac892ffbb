#include "body.hpp"

#include <map>
#include <stdexcept>
#include <vector>

#include "setup_view.hpp"

namespace ctrl_more::python {
namespace {

/// Runs code of Python. Its exceptions become one sentence of C++ with file and line.
template <typename Call>
auto guarded(Call&& call) -> decltype(call()) {
  try {
    return call();
  } catch (py::error_already_set& error) {
    // Ctrl-C is not only a fault of the controller: the program must receive it too.
    const std::string text = shortText(error);  // runs Python, which would take the interrupt
    if (error.matches(PyExc_KeyboardInterrupt)) PyErr_SetInterrupt();
    throw std::runtime_error(text);
  }
}

std::map<std::string, std::vector<double>> gainsOf(const GainValues& gains) { return gains.all(); }

}  // namespace

Script::Script() : own_(std::make_unique<Body>(this)), body_(own_.get()) {}

Script::~Script() { body_->script_ = nullptr; }

Body& Script::body(const py::object& self) {
  body_->self_ = self;
  return *body_;
}

std::unique_ptr<FeedbackController> Script::handOver(py::object self) {
  auto& script = self.cast<Script&>();
  if (!script.own_) {
    refuse("this controller is loaded already; make another instance of its class", Cause::Busy);
  }
  Body& body = *script.own_;
  body.self_ = self;
  body.cacheMethods();
  body.held_ = std::move(self);
  return std::move(script.own_);
}

Body::~Body() {
  if (!held_) {
    if (script_) script_->body_ = nullptr;
    return;
  }
  if (!Py_IsInitialized()) {
    for (py::object* each :
         {&held_, &update_, &reset_, &gains_changed_, &state_, &robot_, &original_, &modified_})
      each->release();
    return;
  }
  py::gil_scoped_acquire locked;
  // The object may be used again, or loaded again.
  if (script_) {
    script_->own_ = std::make_unique<Body>(script_);
    script_->body_ = script_->own_.get();
  }
  for (py::object* each :
       {&update_, &reset_, &gains_changed_, &state_, &robot_, &original_, &modified_})
    *each = py::object();
  held_ = py::object();
}

void Body::cacheMethods() {
  update_ = self_.attr("update");
  const py::object base = py::type::of<Script>();
  const auto own = [&](const char* name) {
    const py::object type = py::type::of(self_);
    return type.attr(name).is(base.attr(name)) ? py::object() : py::object(self_.attr(name));
  };
  reset_ = own("reset");
  gains_changed_ = own("gains_changed");
  state_ = own("state");
}

Description Body::describe() const {
  py::gil_scoped_acquire locked;
  return guarded([&] {
    const py::object result = self_.attr("describe")();
    if (!py::isinstance<Description>(result)) {
      throw std::runtime_error("describe() must return a ctrl_more.Description, but returned " +
                               py::type::of(result).attr("__name__").cast<std::string>());
    }
    auto description = result.cast<Description>();
    if (description.type.empty()) {
      description.type = py::type::of(self_).attr("__name__").cast<std::string>();
    }
    return description;
  });
}

void Body::initialize(Setup& setup) {
  py::gil_scoped_acquire locked;
  const py::object view = py::cast(SetupView{&setup});
  struct End {
    SetupView& view;
    ~End() { view.now = nullptr; }
  } end{view.cast<SetupView&>()};
  guarded([&] { self_.attr("initialize")(view); });
}

void Body::openViews(const RobotStates& robot, const ControlStates& original,
                     ModifiedControlStates& modified) {
  const auto open = [](py::object& object, auto*& view, const void*& last, const auto& store) {
    using View = std::remove_reference_t<decltype(*view)>;
    if (last == &store) return;
    using Store = std::remove_const_t<std::remove_reference_t<decltype(store)>>;
    object = py::cast(View());
    view = object.cast<View*>();
    // Finds an existing Python object of this store, because it owns the numbers.
    view->owner = py::cast(const_cast<Store*>(&store), py::return_value_policy::reference);
    last = &store;
  };
  open(robot_, robot_view_, robot_store_, robot);
  open(original_, original_view_, original_store_, original);
  open(modified_, modified_view_, control_store_, modified.states());
  robot_view_->now = &robot;
  original_view_->now = &original;
  modified_view_->now = &modified;
  modified_view_->setAllWritable(true);
}

void Body::update(const Cycle& cycle, const RobotStates& robot, const ControlStates& original,
                  ModifiedControlStates& modified) {
  py::gil_scoped_acquire locked;
  struct Close {
    Body& body;
    ~Close() {
      if (!body.modified_view_) return;
      body.robot_view_->now = nullptr;
      body.original_view_->now = nullptr;
      body.modified_view_->now = nullptr;
      body.modified_view_->setAllWritable(false);
    }
  } close{*this};
  guarded([&] {
    openViews(robot, original, modified);
    update_(cycle, robot_, original_, modified_);
  });
}

void Body::reset() {
  if (!reset_) return;
  py::gil_scoped_acquire locked;
  guarded([&] { reset_(); });
}

void Body::gainsChanged() {
  if (!gains_changed_) return;
  py::gil_scoped_acquire locked;
  guarded([&] { gains_changed_(); });
}

std::string Body::judgeGains(const GainValues& gains) const {
  py::gil_scoped_acquire locked;
  return guarded([&]() -> std::string {
    const py::object complaint = self_.attr("judge_gains")(gainsOf(gains));
    if (complaint.is_none()) return "";
    if (!py::isinstance<py::str>(complaint)) {
      throw std::runtime_error("judge_gains() must return a sentence or None");
    }
    return complaint.cast<std::string>();
  });
}

void Body::state(Numbers<> values) const {
  if (!state_) return;
  py::gil_scoped_acquire locked;
  guarded([&] { values = toVector(state_(), "state()"); });
}

}  // namespace ctrl_more::python

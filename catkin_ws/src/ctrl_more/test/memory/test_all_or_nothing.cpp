// Every request succeeds completely or changes nothing, at each point where memory can run out.
#include <cstdlib>
#include <new>
#include <sstream>

#include "ctrl_more/feedback_controller.hpp"
#include "test_support.hpp"

namespace {

long allocations_left = -1;  // until one fails; < 0: none does
bool all_later_fail = false;
bool failed = false;

void* allocate(std::size_t size, std::size_t alignment) {
  if (allocations_left > 0 && --allocations_left == 0) {
    failed = true;
    allocations_left = all_later_fail ? 1 : -1;
    throw std::bad_alloc();
  }
  const std::size_t rounded = (size + alignment - 1) / alignment * alignment;
  if (void* memory = std::aligned_alloc(alignment, rounded ? rounded : alignment)) return memory;
  throw std::bad_alloc();
}

}  // namespace

void* operator new(std::size_t size) { return allocate(size, alignof(std::max_align_t)); }
void* operator new(std::size_t size, std::align_val_t alignment) {
  return allocate(size, static_cast<std::size_t>(alignment));
}
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }
void operator delete(void* memory, std::align_val_t) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t, std::align_val_t) noexcept { std::free(memory); }

namespace ctrl_more {
namespace {

// A rig with everything that a request can change.
struct Crowd : Rig {
  TestController* c = nullptr;

  Crowd() : Rig(0.0, false, false) {
    addNamed("a", true);
    addNamed("b", true);
    c = addNamed("c", false);
    manager->pause("b");
    manager->setProfile("some", {"a"});
  }

  TestController* addNamed(const std::string& name, bool enabled) {
    auto controller = adder("pose", "ee", 1.0);
    controller->description.gain("k", 1.0).range(0.0, 9.0).in("1").about("not used");
    return add(std::move(controller), name, enabled);
  }

  // All queries, and the effect of a cycle.
  std::string everything() {
    std::ostringstream text;
    for (const std::string& name : manager->getControllersNames()) text << name << ' ';
    text << "| ";
    for (const std::string& name : manager->getExecutionOrder()) {
      const ControllerStatus s = manager->status(name);
      text << name << (s.enabled ? " on" : " off");
      for (const std::string& reason : s.reasons) text << " '" << reason << "'";
      for (const auto& gain : manager->getGains(name).all()) text << ' ' << gain.second[0];
      text << "; ";
    }
    for (const std::string& profile : manager->getProfiles()) text << profile << ' ';
    for (const SignalInfo& s : robot.signals(RobotSource::Measured)) text << s.key << ' ';
    for (const SignalInfo& s : control.signals(ControlContainer::Zmp)) text << s.key << ' ';
    text << (c ? (c->isEnabled() ? "c on" : "c off") : "");
    return text.str();
  }
};

using Request = std::function<bool(Crowd&)>;

// Runs a request with each of its allocations failing in turn. A failed request must change
// nothing; the cycle continues, and the same request works afterwards.
void failAtEachAllocation(const std::string& what, bool frozen, const Request& prepare,
                          const Request& request) {
  std::string wanted;
  {
    Crowd crowd;
    if (frozen) crowd.step();
    if (prepare) prepare(crowd);
    ASSERT_TRUE(request(crowd)) << what;
    wanted = crowd.everything();
  }
  for (const bool later_too : {false, true}) {
    for (long n = 1; n < 5000; ++n) {
      SCOPED_TRACE(what + (frozen ? ", frozen" : "") + (later_too ? ", all from " : ", only ") +
                   std::to_string(n));
      Crowd crowd;
      if (frozen) crowd.step();
      if (prepare) prepare(crowd);
      const std::string before = crowd.everything();
      failed = false;
      bool done = false;
      all_later_fail = later_too;
      allocations_left = n;
      try {
        done = request(crowd);
      } catch (...) {
      }
      allocations_left = -1;
      ASSERT_EQ(crowd.everything(), done ? wanted : before);
      crowd.step(2);
      if (!done) {
        ASSERT_TRUE(request(crowd)) << "the same again";
        ASSERT_EQ(crowd.everything(), wanted);
        crowd.step(2);
      }
      if (!failed) return;
    }
  }
}

void failAtEachAllocation(const std::string& what, const Request& prepare, const Request& request) {
  for (const bool frozen : {false, true}) failAtEachAllocation(what, frozen, prepare, request);
}

TEST(AllOrNothing, Changes) {
  failAtEachAllocation("several steps", nullptr, [](Crowd& x) {
    GainValues gains = x.manager->getGains("a");
    gains.set("k", {3.0});
    return x.manager
        ->apply(Change()
                    .enable("c")
                    .gains("a", gains.all())
                    .pause("a", "rest")
                    .resume("b", "other")
                    .order({"c", "b", "a"}))
        .ok();
  });
  failAtEachAllocation("profile", nullptr,
                       [](Crowd& x) { return x.manager->applyProfile("some").ok(); });
  failAtEachAllocation("by signal", nullptr,
                       [](Crowd& x) { return x.manager->pauseAllUsingControlState("ee").ok(); });
  failAtEachAllocation("gains", nullptr, [](Crowd& x) {
    return x.manager->setGains("b", {{"k", {2.0}}}).ok();
  });
  failAtEachAllocation("new profile", nullptr,
                       [](Crowd& x) { return x.manager->setProfile("new", {"b"}).ok(); });
}

TEST(AllOrNothing, Withdrawal) {
  static std::uint64_t generation = 0;
  failAtEachAllocation(
      "withdraw",
      [](Crowd& x) {
        const Status status = x.manager->prepare(Change().enable("c").pause("a"));
        generation = status.generation();
        return status.ok();
      },
      [](Crowd& x) { return x.manager->withdraw(generation).ok(); });
}

TEST(AllOrNothing, AddingAndUnloading) {
  failAtEachAllocation("add", nullptr, [](Crowd& x) {
    auto controller = adder("pose", "ee", 1.0);
    controller->description.gain("k", 1.0).in("1").about("not used");
    return x.manager->addController(std::move(controller), "d").ok();
  });
  failAtEachAllocation("unload", nullptr, [](Crowd& x) {
    if (!x.manager->unload("c")) return false;
    x.c = nullptr;
    return true;
  });
}

TEST(AllOrNothing, ListFile) {
  // Held open: what is tried here is the manager, not the dynamic linker.
  const auto held = PluginLibrary::open(kPlugins + "/libgood.so", prototypes());
  const ConfigNode list = ConfigNode::fromText(
      "loadControllers: [x, y]\nx: {libPath: libgood.so, enabled: true}\n"
      "y: {libPath: libgood.so}\nprofiles: {mine: [x], yours: [y, a]}\nsharedSignals: cascade\n",
      "list.yaml");
  failAtEachAllocation("load", nullptr,
                       [&](Crowd& x) { return x.manager->load(list, kPlugins).ok(); });
}

}  // namespace
}  // namespace ctrl_more

#include <csignal>
#include <cstdlib>
#include <stdexcept>
#include <string>

#include <unistd.h>

#include "plugin.hpp"

// Makes the fault of CTRL_MORE_TEST_FAULT in the constructor of a static object or in describe().
static void fault(const std::string& where) {
  const char* const wanted = std::getenv("CTRL_MORE_TEST_FAULT");
  const std::string what = wanted ? wanted : "";
  if (what.compare(0, where.size(), where) != 0) return;
  if (what == where + "throw") throw std::runtime_error("no such camera");
  if (what == where + "exit") std::exit(0);
  if (what == where + "abort") std::abort();
  if (what == where + "crash") std::raise(SIGSEGV);
  while (what == where + "hang") pause();
}

static const struct Camera {
  Camera() { fault("open_"); }
} camera;

class StaticObject : public ctrl_more_test::Plugin {
 public:
  StaticObject() : Plugin("StaticObject") {}
  ctrl_more::Description describe() const override {
    fault("describe_");
    return Plugin::describe();
  }
};
CTRL_MORE_REGISTER_CONTROLLER(StaticObject, "StaticObject")

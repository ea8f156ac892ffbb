#include "plugin.hpp"

// A library with two controllers.
class First : public ctrl_more_test::Plugin {
 public:
  First() : Plugin("First") {}
};
class Second : public ctrl_more_test::Plugin {
 public:
  Second() : Plugin("Second") {}
};
namespace {
ctrl_more::FeedbackController* makeFirst() { return new First(); }
ctrl_more::FeedbackController* makeSecond() { return new Second(); }
const ctrl_more::PrototypeRegistration first("First", &makeFirst);
const ctrl_more::PrototypeRegistration second("Second", &makeSecond);
}  // namespace

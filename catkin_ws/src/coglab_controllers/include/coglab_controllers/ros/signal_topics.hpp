/// @file
/// The topics of the file of signals: robot signals in, references, corrections and states out.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <string>
#include <vector>

#include <ros/ros.h>

#include "coglab_controllers/manager/controller_manager.hpp"

namespace coglab_controllers {

class SignalReading;

/// Rules of this process for the topics of a file of signals. Names are resolved with its
/// remappings. Outputs may not use topics of this node, the arm, tf or rosout. A topic that exists
/// keeps its type.
/// @param node namespace of the manager
TopicRules topicRules(const ros::NodeHandle& node);

/// Subscribes to the topics of the manager's robot signals and publishes its outputs. Relative
/// names begin in the namespace above the manager's.
///
/// Unusable messages are logged once, and again if the same reason returns after 10 s. A topic that
/// is silent for 0.5 s is also logged once. Its signals become absent at their largest age, and
/// controllers that need them wait.
class SignalTopics {
 public:
  /// @param node namespace of the manager; its callback queue is used
  SignalTopics(const ros::NodeHandle& node, ControllerManager& manager);
  SignalTopics(const SignalTopics&) = delete;
  SignalTopics& operator=(const SignalTopics&) = delete;

  /// Publishes the outputs that are due, and watches the inputs. Publisher thread.
  void publish();

 private:
  struct Row {
    std::size_t index;                                   ///< in SignalInputs
    std::map<SignalRefusal, std::int64_t> refused = {};  ///< last time, ns; callback's thread
    bool absent = false;                                 ///< logged; publisher thread
  };
  /// A topic with all its rows. Its callbacks come one after another.
  struct Topic {
    ros::Subscriber subscriber;
    std::deque<Row> rows;
    std::string writer;         ///< node whose messages are accepted
    std::int64_t heard_ns = 0;  ///< time of the last message from this node
    bool unreadable = false, two_writers = false;
    double max_age = 0.0;  ///< s, largest of the rows
  };
  struct Output {
    const SignalOutput* row;
    ros::Publisher publisher;
    std::int64_t due_ns = 0;
  };

  template <typename Message>
  void listen(const std::string& name, Topic& topic);
  bool isWriter(Topic& topic, const std::string& node);
  void take(Topic& topic, const SignalReading& reading);
  void watch();
  std::vector<double> valueOf(Output& output);
  void send(const Output& output, const std::vector<double>& values);
  std::string nameOf(const Row& row) const;

  ControllerManager& manager_;
  SignalInputs& inputs_;
  ros::NodeHandle node_;
  std::int64_t started_ns_;
  std::deque<Topic> topics_;
  std::deque<Output> outputs_;
  FeedbackStage::Snapshot references_;  // of this round
  ctrl_more::CycleRecord cycle_;
};

}  // namespace coglab_controllers

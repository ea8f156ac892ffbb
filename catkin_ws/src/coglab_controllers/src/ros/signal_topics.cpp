#include "coglab_controllers/ros/signal_topics.hpp"

#include <algorithm>
#include <map>
#include <set>
#include <stdexcept>

#include <Eigen/Geometry>

#include "coglab_controllers/ros/signal_messages.hpp"
#include "coglab_rt/ros/ros_time.hpp"

namespace coglab_controllers {
namespace {

constexpr double kFirstMessage = 5.0;  // s after the start without a message until it is logged
constexpr double kOtherWriter = 1.0;   // s of silence after which another node may write a topic
constexpr double kStopped = 0.5;       // s of silence after which a topic has stopped, for the log
constexpr double kForgotten = 10.0;    // s after which the same refusal is logged again

double seconds(std::int64_t nanoseconds) { return 1e-9 * static_cast<double>(nanoseconds); }

/// A correction: the difference, or for orientations the left rotation.
std::vector<double> changeOf(const ctrl_more::Attribution& change, ctrl_more::SignalKind kind) {
  std::vector<double> values(change.after);
  const std::size_t quaternion = kind == ctrl_more::SignalKind::Vector ? values.size()
                                 : kind == ctrl_more::SignalKind::Pose ? 3
                                                                       : 0;
  for (std::size_t i = 0; i < quaternion; ++i) values[i] -= change.before[i];
  if (quaternion < values.size()) {
    using Map = Eigen::Map<const Eigen::Quaterniond>;
    const Eigen::Quaterniond turn =
        Map(change.after.data() + quaternion) * Map(change.before.data() + quaternion).conjugate();
    std::copy_n(turn.coeffs().data(), 4, values.data() + quaternion);
  }
  return values;
}

void setVectors(geometry_msgs::Vector3& first, geometry_msgs::Vector3& second,
                const std::vector<double>& values) {
  first.x = values[0];
  first.y = values[1];
  first.z = values[2];
  second.x = values[3];
  second.y = values[4];
  second.z = values[5];
}

bool isBelow(const std::string& topic, const std::string& space) {
  return topic.rfind(space + "/", 0) == 0;
}

/// Types of the topics with a publisher or subscriber now, from the ROS master; empty if it does
/// not answer. The master also keeps the types of topics without any node.
std::map<std::string, std::string> typesInUse() {
  XmlRpc::XmlRpcValue request, response, types, state;
  std::map<std::string, std::string> used;
  request[0] = ros::this_node::getName();
  if (!ros::master::execute("getTopicTypes", request, response, types, false) ||
      !ros::master::execute("getSystemState", request, response, state, false)) {
    return used;
  }
  for (const int side : {0, 1}) {
    for (int i = 0; i < state[side].size(); ++i) used[std::string(state[side][i][0])];
  }
  for (int i = 0; i < types.size(); ++i) {
    const auto found = used.find(std::string(types[i][0]));
    if (found != used.end()) found->second = std::string(types[i][1]);
  }
  return used;
}

}  // namespace

TopicRules topicRules(const ros::NodeHandle& node) {
  const ros::NodeHandle above(ros::names::parentNamespace(node.getNamespace()));
  const std::string arm = above.resolveName("lwr");
  std::vector<std::string> published, subscribed;
  ros::this_node::getAdvertisedTopics(published);
  ros::this_node::getSubscribedTopics(subscribed);
  std::set<std::string> own = {"/tf",         "/tf_static",   "/rosout",
                               "/rosout_agg", "/diagnostics", "/clock"};
  own.insert(published.begin(), published.end());
  own.insert(subscribed.begin(), subscribed.end());
  TopicRules rules;
  rules.resolve = [above](const std::string& topic) { return above.resolveName(topic); };
  rules.refusal = [own, arm, manager = node.getNamespace(), types = typesInUse()](
                      const std::string& topic, const std::string& type, bool out) -> std::string {
    if (isBelow(topic, manager)) {
      return "belongs to the controller manager itself; choose a topic outside of " + manager;
    }
    const bool mine = own.count(topic) != 0 || isBelow(topic, arm);
    if (out && mine) return "is one that this node or the arm has already; choose another name";
    const auto known = types.find(topic);
    const std::string other = known == types.end() ? "" : known->second;
    if (other.empty() || other == "*" || other == type) return "";
    if (!out && !mine) {  // its publisher may be another one later
      ROS_WARN("%s is a %s at present, and the file of signals expects a %s: waiting for that",
               topic.c_str(), other.c_str(), type.c_str());
      return "";
    }
    return "is a " + other + " and not a " + type + "; choose another topic or type";
  };
  return rules;
}

SignalTopics::SignalTopics(const ros::NodeHandle& node, ControllerManager& manager)
    : manager_(manager),
      inputs_(manager.feedbackStage().signals()),
      node_(ros::names::parentNamespace(node.getNamespace())),
      started_ns_(steadyNow()) {
  node_.setCallbackQueue(node.getCallbackQueue());
  using Listen = void (SignalTopics::*)(const std::string&, Topic&);
  const std::map<std::string, Listen> types = {
      {"sensor_msgs/Imu", &SignalTopics::listen<sensor_msgs::Imu>},
      {"geometry_msgs/WrenchStamped", &SignalTopics::listen<geometry_msgs::WrenchStamped>},
      {"geometry_msgs/PoseStamped", &SignalTopics::listen<geometry_msgs::PoseStamped>},
      {"geometry_msgs/TwistStamped", &SignalTopics::listen<geometry_msgs::TwistStamped>},
      {"sensor_msgs/JointState", &SignalTopics::listen<sensor_msgs::JointState>},
      {"std_msgs/Float64MultiArray", &SignalTopics::listen<std_msgs::Float64MultiArray>},
      {"coglab_msgs/FingertipForces", &SignalTopics::listen<coglab_msgs::FingertipForces>}};
  std::map<std::string, Topic*> by_name;
  for (std::size_t i = 0; i < inputs_.rows().size(); ++i) {
    const SignalInput& row = inputs_.rows()[i];
    Topic*& topic = by_name[node_.resolveName(row.topic)];
    if (topic == nullptr) topic = &topics_.emplace_back();
    topic->rows.push_back({i});
    topic->max_age = std::max(topic->max_age, row.max_age);
  }
  for (const auto& [name, topic] : by_name) {
    (this->*types.at(inputs_.rows()[topic->rows.front().index].type->name))(name, *topic);
    ROS_INFO("robot signals from %s", topic->subscriber.getTopic().c_str());
  }
  using Type = SignalOutput::Type;
  for (const SignalOutput& row : manager_.signalOutputs()) {
    const auto advertise = [&](auto message) {
      return node_.advertise<decltype(message)>(row.topic, 10);
    };
    Output& output = outputs_.emplace_back();
    output.row = &row;
    output.publisher = row.type == Type::Pose     ? advertise(geometry_msgs::PoseStamped())
                       : row.type == Type::Twist  ? advertise(geometry_msgs::TwistStamped())
                       : row.type == Type::Wrench ? advertise(geometry_msgs::WrenchStamped())
                       : row.type == Type::Joints ? advertise(sensor_msgs::JointState())
                                                  : advertise(std_msgs::Float64MultiArray());
    if (!output.publisher)
      throw std::runtime_error(row.place + ": " + row.topic + " was not advertised");
  }
}

template <typename Message>
void SignalTopics::listen(const std::string& name, Topic& topic) {
  using Event = ros::MessageEvent<const Message>;
  const boost::function<void(const Event&)> callback = [this, &topic](const Event& event) {
    if (!isWriter(topic, event.getPublisherName())) return;
    try {
      const SignalReading reading(*event.getConstMessage());
      topic.unreadable = false;
      take(topic, reading);
    } catch (const std::invalid_argument& error) {
      if (!topic.unreadable) {
        ROS_WARN("%s is ignored: %s", topic.subscriber.getTopic().c_str(), error.what());
      }
      topic.unreadable = true;
    }
  };
  ros::SubscribeOptions options;
  options.initByFullCallbackType<const Event&>(name, 1, callback);
  options.transport_hints = ros::TransportHints().tcpNoDelay();
  topic.subscriber = node_.subscribe(options);
  if (!topic.subscriber) throw std::runtime_error("topic " + name + " was not subscribed");
}

std::string SignalTopics::nameOf(const Row& row) const {
  const SignalInput& input = inputs_.rows()[row.index];
  return std::string(ctrl_more::nameOf(input.source)) + "/" + input.key;
}

/// A signal has one writer: the first node, until it is silent.
bool SignalTopics::isWriter(Topic& topic, const std::string& node) {
  const std::int64_t now = steadyNow();
  const bool silent = seconds(now - topic.heard_ns) > std::max(kOtherWriter, topic.max_age);
  if (node == topic.writer || topic.writer.empty() || silent) {
    if (node != topic.writer) topic.two_writers = false;
    topic.writer = node;
    topic.heard_ns = now;
    return true;
  }
  if (!topic.two_writers) {
    ROS_WARN("%s has two publishers: messages of %s are used, those of %s are ignored",
             topic.subscriber.getTopic().c_str(), topic.writer.c_str(), node.c_str());
  }
  topic.two_writers = true;
  return false;
}

void SignalTopics::take(Topic& topic, const SignalReading& reading) {
  const std::int64_t now = steadyNow();
  for (Row& row : topic.rows) {
    const SignalPost post = inputs_.post(row.index, reading.message(), now);
    if (post.refusal == SignalRefusal::None) continue;
    const auto [last, first] = row.refused.insert({post.refusal, now});
    if (first || seconds(now - last->second) > kForgotten) {
      ROS_WARN("signal %s: a message on %s is ignored: %s", nameOf(row).c_str(),
               topic.subscriber.getTopic().c_str(), post.text.c_str());
    }
    last->second = now;
  }
}

void SignalTopics::publish() {
  watch();
  const std::int64_t now = steadyNow();
  const auto isDue = [now](const Output& output) {
    return now >= output.due_ns && output.publisher.getNumSubscribers() > 0;
  };
  if (std::none_of(outputs_.begin(), outputs_.end(), isDue)) return;
  if (!manager_.feedbackStage().readReferences(references_)) return;
  cycle_ = manager_.feedback().lastCycle();
  for (Output& output : outputs_) {
    if (!isDue(output)) continue;
    const auto period = static_cast<std::int64_t>(1e9 / output.row->rate);
    output.due_ns = std::max(output.due_ns + period, now);
    const std::vector<double> values = valueOf(output);
    if (!values.empty()) send(output, values);
  }
}

void SignalTopics::watch() {
  const std::int64_t now = steadyNow();
  for (Topic& topic : topics_) {
    for (Row& row : topic.rows) {
      const std::int64_t newest = inputs_.newestStamp(row.index);
      const bool never = newest == ctrl_more::kNeverWritten;
      const double limit =
          never ? kFirstMessage : std::max(kStopped, inputs_.rows()[row.index].max_age);
      const bool absent = seconds(now - (never ? started_ns_ : newest)) > limit;
      if (absent && !row.absent) {
        const bool alone = never && topic.subscriber.getNumPublishers() == 0;
        const std::string what =
            alone ? "no node publishes it as " + inputs_.rows()[row.index].type->name
                  : std::string(never ? "no usable message" : "nothing new");
        ROS_WARN("signal %s is absent: %s on %s for %.3g s; controllers that need it wait",
                 nameOf(row).c_str(), what.c_str(), topic.subscriber.getTopic().c_str(), limit);
      } else if (!absent && row.absent) {
        ROS_INFO("signal %s is there", nameOf(row).c_str());
      }
      row.absent = absent;
    }
  }
}

/// The numbers of an output; empty if there are none at present.
std::vector<double> SignalTopics::valueOf(Output& output) {
  const SignalOutput& row = *output.row;
  if (row.kind == SignalOutput::Kind::Reference) {
    const ctrl_more::ControlSignal signal =
        manager_.feedbackStage().references().states.find(row.container, row.key);
    const auto first = references_.values.begin() + signal.offset();
    return {first, first + signal.size()};
  }
  if (row.kind == SignalOutput::Kind::Correction) {
    const std::string name = std::string(ctrl_more::nameOf(row.container)) + "/" + row.key;
    for (const ctrl_more::Attribution& change : cycle_.changes) {
      if (change.controller != row.controller || change.signal != name) continue;
      return changeOf(change, ctrl_more::kindOf(row.container));
    }
    return {};
  }
  for (const ctrl_more::ControllerState& state : cycle_.states) {
    if (state.controller != row.controller) continue;
    if (row.key.empty()) return state.values;
    const auto specs = manager_.feedback().describe(row.controller).states;
    for (std::size_t i = 0; i < specs.size(); ++i) {
      if (specs[i].name == row.key) return {state.values[i]};
    }
  }
  return {};
}

void SignalTopics::send(const Output& output, const std::vector<double>& values) {
  const SignalOutput& row = *output.row;
  const RobotSetup& robot = *manager_.settings().robot;
  const auto stamped = [&](auto message) {
    message.header.stamp = coglab_rt::toRos(references_.stamp_ns);
    message.header.frame_id = robot.chain.baseLink();
    return message;
  };
  switch (row.type) {
    case SignalOutput::Type::Pose: {
      auto message = stamped(geometry_msgs::PoseStamped());
      message.pose.position.x = values[0];
      message.pose.position.y = values[1];
      message.pose.position.z = values[2];
      message.pose.orientation.x = values[3];
      message.pose.orientation.y = values[4];
      message.pose.orientation.z = values[5];
      message.pose.orientation.w = values[6];
      output.publisher.publish(message);
      break;
    }
    case SignalOutput::Type::Twist: {
      auto message = stamped(geometry_msgs::TwistStamped());
      setVectors(message.twist.linear, message.twist.angular, values);
      output.publisher.publish(message);
      break;
    }
    case SignalOutput::Type::Wrench: {
      auto message = stamped(geometry_msgs::WrenchStamped());
      setVectors(message.wrench.force, message.wrench.torque, values);
      output.publisher.publish(message);
      break;
    }
    case SignalOutput::Type::Joints: {
      auto message = stamped(sensor_msgs::JointState());
      message.name = robot.chain.jointNames();
      (row.key == "Velocity" ? message.velocity
       : row.key == "Torque" ? message.effort
                             : message.position) = values;
      output.publisher.publish(message);
      break;
    }
    case SignalOutput::Type::Array: {
      std_msgs::Float64MultiArray message;
      message.layout.dim.resize(1);
      message.layout.dim[0].label = row.key;
      message.layout.dim[0].size = message.layout.dim[0].stride =
          static_cast<std::uint32_t>(values.size());
      message.data = values;
      output.publisher.publish(message);
      break;
    }
  }
}

}  // namespace coglab_controllers

#include "coglab_controllers/ros/reconfigure_server.hpp"

#include <utility>

#include <dynamic_reconfigure/ConfigDescription.h>

#include "coglab_controllers/manager/tunables.hpp"

namespace coglab_controllers {
namespace {

using dynamic_reconfigure::Config;

/// A message with one number for each field, chosen by `value`.
Config configOf(const std::vector<ReconfigureField>& fields, double ReconfigureField::*value) {
  Config config;
  for (const ReconfigureField& field : fields) {
    dynamic_reconfigure::DoubleParameter parameter;
    parameter.name = field.name;
    parameter.value = field.*value;
    config.doubles.push_back(parameter);
  }
  dynamic_reconfigure::GroupState group;
  group.name = "Default";
  group.state = true;
  config.groups.push_back(group);
  return config;
}

std::vector<ReconfigureField> fieldsOf(const Tunables& tunables,
                                       const std::map<std::string, double>& first) {
  std::vector<ReconfigureField> fields;
  for (const Tunable& one : tunables.all()) {
    fields.push_back({one.name, one.text, one.wanted(), one.least, one.most, first.at(one.name)});
  }
  return fields;
}

}  // namespace

ReconfigureServer::ReconfigureServer(const ros::NodeHandle& node, Read read, Write write)
    : node_(node), read_(std::move(read)), write_(std::move(write)) {
  const std::vector<ReconfigureField> fields = read_();
  dynamic_reconfigure::ConfigDescription description;
  dynamic_reconfigure::Group group;
  group.name = "Default";
  for (const ReconfigureField& field : fields) {
    dynamic_reconfigure::ParamDescription parameter;
    parameter.name = field.name;
    parameter.type = "double";
    parameter.description = field.text;
    group.parameters.push_back(parameter);
  }
  description.groups.push_back(group);
  description.min = configOf(fields, &ReconfigureField::least);
  description.max = configOf(fields, &ReconfigureField::most);
  description.dflt = configOf(fields, &ReconfigureField::fallback);
  descriptions_ =
      node_.advertise<dynamic_reconfigure::ConfigDescription>("parameter_descriptions", 1, true);
  descriptions_.publish(description);
  updates_ = node_.advertise<Config>("parameter_updates", 1, true);
  publish();
  service_ = node_.advertiseService("set_parameters", &ReconfigureServer::onSet, this);
}

ReconfigureServer::ReconfigureServer(const ros::NodeHandle& node, Tunables& tunables)
    : ReconfigureServer(
          node,
          [&tunables, first =
                          [&tunables] {
                            std::map<std::string, double> values;
                            for (const Tunable& one : tunables.all())
                              values[one.name] = one.wanted();
                            return values;
                          }()] { return fieldsOf(tunables, first); },
          [&tunables](const std::map<std::string, double>& changed) {
            return tunables.set(changed);
          }) {}

void ReconfigureServer::publish() { updates_.publish(configOf(read_(), &ReconfigureField::value)); }

bool ReconfigureServer::onSet(dynamic_reconfigure::Reconfigure::Request& request,
                              dynamic_reconfigure::Reconfigure::Response& response) {
  const Config& config = request.config;
  std::map<std::string, double> changed;
  for (const auto& parameter : config.doubles) changed[parameter.name] = parameter.value;
  // A client in Python sends 2 as a whole number.
  for (const auto& parameter : config.ints) changed[parameter.name] = parameter.value;
  Answer answer;
  if (!config.bools.empty() || !config.strs.empty()) {
    const std::string name = config.bools.empty() ? config.strs[0].name : config.bools[0].name;
    answer = Answer::invalid(name + ": expected a number, got a flag or a text");
  } else {
    answer = write_(changed);
  }
  // Clients of this protocol read the present values from the response and the topic. There is no
  // field for an error message, and the usual client does not show a failed call.
  if (!answer.success) {
    ROS_WARN("%s/set_parameters refused: %s; nothing changed", node_.getNamespace().c_str(),
             answer.message.c_str());
  }
  response.config = configOf(read_(), &ReconfigureField::value);
  updates_.publish(response.config);
  return true;
}

}  // namespace coglab_controllers

/// @file
/// Numbers that rqt_reconfigure and other clients of dynamic_reconfigure can show and change.
#pragma once

#include <functional>
#include <map>
#include <string>
#include <vector>

#include <dynamic_reconfigure/Config.h>
#include <dynamic_reconfigure/Reconfigure.h>
#include <ros/console.h>
#include <ros/node_handle.h>

#include "coglab_controllers/names.hpp"

namespace coglab_controllers {

class Tunables;

/// One number of a ReconfigureServer.
struct ReconfigureField {
  std::string name, text;  ///< a Python identifier; a sentence with its unit
  double value = 0.0, least = 0.0, most = 0.0, fallback = 0.0;
};

/// Implements the protocol of dynamic_reconfigure below its node: service `set_parameters`, latched
/// topics `parameter_descriptions` and `parameter_updates`. The program defines the numbers at run
/// time, without a .cfg file. If a value is out of range or not a number, or a name is unknown,
/// nothing changes: the response contains the present values, and the reason is logged.
class ReconfigureServer {
 public:
  using Read = std::function<std::vector<ReconfigureField>()>;
  using Write = std::function<Answer(const std::map<std::string, double>& changed)>;

  /// @param read returns the present numbers, always in the same order
  /// @param write sets some of them, all or nothing
  ReconfigureServer(const ros::NodeHandle& node, Read read, Write write);
  /// Shows and changes the gains of a motion controller, which outlives this object.
  ReconfigureServer(const ros::NodeHandle& node, Tunables& tunables);
  ~ReconfigureServer() { service_.shutdown(); }
  ReconfigureServer(const ReconfigureServer&) = delete;
  ReconfigureServer& operator=(const ReconfigureServer&) = delete;

  /// Publishes the present numbers after they were changed in another way.
  void publish();

 private:
  bool onSet(dynamic_reconfigure::Reconfigure::Request& request,
             dynamic_reconfigure::Reconfigure::Response& response);

  ros::NodeHandle node_;
  Read read_;
  Write write_;
  ros::Publisher descriptions_, updates_;
  ros::ServiceServer service_;
};

}  // namespace coglab_controllers

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

/// Speaks the protocol of dynamic_reconfigure below its node: service `set_parameters`, latched
/// topics `parameter_descriptions` and `parameter_updates`. The numbers come from the program at
/// run time, so no .cfg file describes them. If a value is out of its range or no number, or a name
/// is unknown, nothing changes: the answer has the values in force, the log the reason.
class ReconfigureServer {
 public:
  using Read = std::function<std::vector<ReconfigureField>()>;
  using Write = std::function<Answer(const std::map<std::string, double>& changed)>;

  /// @param read the present numbers, always the same ones in the same order
  /// @param write sets some of them, all or none
  ReconfigureServer(const ros::NodeHandle& node, Read read, Write write);
  /// Shows and changes the gains of a motion controller, which outlives this object.
  ReconfigureServer(const ros::NodeHandle& node, Tunables& tunables);
  ~ReconfigureServer() { service_.shutdown(); }
  ReconfigureServer(const ReconfigureServer&) = delete;
  ReconfigureServer& operator=(const ReconfigureServer&) = delete;

  /// Tells the present numbers to the clients: they have been changed by another way.
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

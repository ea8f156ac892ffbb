#include "lwr_fri_bridge/bridge/bridge_config.hpp"

#include <sstream>
#include <stdexcept>
#include <string>

namespace lwr_fri_bridge {

void checkParameter(const char* name, double value, double low, double high) {
  if (value >= low && value <= high) return;
  std::ostringstream text;
  text << "parameter " << name << " = " << value << " is outside its range " << low << ".." << high;
  throw std::invalid_argument(text.str());
}

void BridgeConfig::check() const {
  checkParameter("tool_number", tool_number, 0, 16);
  checkParameter("position_margin", position_margin, 0.0, 0.5);
  // Motion planners use the margin of the table. A larger one here would stop accepted motions.
  checkParameter("position_margin (at most that of the joint limits table)", position_margin, 0.0,
                 limits.position_margin);
  checkParameter("set_point_leash/position", leash.position, 0.005, 0.5);
  checkParameter("set_point_leash/impedance", leash.impedance, 0.005, 0.5);
  checkParameter("set_point_leash/load", leash.load, 0.0, 70.0);
  checkParameter("velocity_filter_time", velocity_filter_time, 0.0, 0.2);
  checkParameter("command_timeout", command_timeout, 0.005, 1.0);
  checkParameter("topic_timeout", topic_timeout, 0.005, 1.0);
  checkParameter("receive_timeout", receive_timeout, 0.05, 5.0);
  checkParameter("start_timeout", requests.start_timeout, 0.5, 120.0);
  checkParameter("stop_timeout", requests.stop_timeout, 0.1, 30.0);
  checkParameter("silent_stop_timeout", requests.silent_stop_timeout, 0.1, 30.0);
  for (int i = 0; i < 7; ++i) {
    const std::string& joint = limits.names[static_cast<std::size_t>(i)];
    if (joint != kJointNames[i]) {
      throw std::invalid_argument("joint limits: joints[" + std::to_string(i) + "] = '" + joint +
                                  "': expected '" + kJointNames[i] +
                                  "', the order of FRI; correct the table that limits_file names");
    }
    const double room = limits.upper_position[i] - limits.lower_position[i];
    checkParameter("position_margin (twice, within the range of a joint)", 2.0 * position_margin,
                   0.0, room);
    checkParameter("limits.velocity", limits.velocity[i], 1e-3, 10.0);
    checkParameter("limits.acceleration", limits.acceleration[i], 1e-2, 1e3);
    checkParameter("limits.jerk", limits.jerk[i], 0.1, 1e6);
  }
}

}  // namespace lwr_fri_bridge

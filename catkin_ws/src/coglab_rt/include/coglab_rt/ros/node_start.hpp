/// @file
/// Ensures that a node does not replace a running node of the same name. Otherwise roscpp would end
/// the running node, roslaunch would restart it, and two launches on one ROS master would end each
/// other's nodes again and again.
#pragma once

#include <chrono>
#include <cstdint>
#include <cstdio>
#include <string>
#include <thread>

#include <ros/master.h>
#include <ros/network.h>
#include <ros/this_node.h>
#include <xmlrpcpp/XmlRpcClient.h>
#include <xmlrpcpp/XmlRpcDispatch.h>
#include <xmlrpcpp/XmlRpcValue.h>

namespace coglab_rt {

/// The running node that has this node's name, as text; empty if there is none.
inline std::string livingNamesake() {
  XmlRpc::XmlRpcValue who, response, uri;
  who[0] = who[1] = ros::this_node::getName();
  if (!ros::master::execute("lookupNode", who, response, uri, false)) return "";
  std::string host;
  std::uint32_t port = 0;
  const std::string address = uri;
  if (!ros::network::splitURI(address, host, port)) return "";
  XmlRpc::XmlRpcClient node(host.c_str(), static_cast<int>(port), "/");
  XmlRpc::XmlRpcValue caller, process;
  caller[0] = ros::this_node::getName();
  if (!node.executeNonBlock("getPid", caller)) return "";
  XmlRpc::XmlRpcDispatch dispatch;
  dispatch.addSource(&node,
                     XmlRpc::XmlRpcDispatch::WritableEvent | XmlRpc::XmlRpcDispatch::Exception);
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(2);
  bool done = false;
  while (!(done = node.executeCheckDone(process)) && std::chrono::steady_clock::now() < end)
    dispatch.work(0.02);  // s
  dispatch.removeSource(&node);
  if (!done) {
    return "at " + address +
           ", which does not answer (if its computer is off, remove it: rosnode cleanup)";
  }
  if (process.getType() != XmlRpc::XmlRpcValue::TypeArray || process.size() != 3) return "";
  return "process " + std::to_string(static_cast<int>(process[2])) + " at " + address;
}

/// Call it after ros::init and before the first NodeHandle. Returns false, with a sentence on the
/// error output, if a running node has this name for 2 s. During this time a node that is being
/// restarted may end.
inline bool nameIsFree() {
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(2);
  for (;;) {
    const std::string there = livingNamesake();
    if (there.empty()) return true;
    if (std::chrono::steady_clock::now() > end) {
      std::fprintf(stderr,
                   "[coglab] error: another node has the name %s: %s; end it first, or use a ROS "
                   "master of your own\n",
                   ros::this_node::getName().c_str(), there.c_str());
      return false;
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(200));
  }
}

}  // namespace coglab_rt

/// @file
/// A node does not take the place of a living one of its name: roscpp would end that one, roslaunch
/// would start it again, and two launches on one ROS master would end each other's nodes for ever.
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

/// Who has this node's name with the ROS master, in words; empty where nobody lives.
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
  if (!done) return "at " + address + ", which does not answer";
  if (process.getType() != XmlRpc::XmlRpcValue::TypeArray || process.size() != 3) return "";
  return "process " + std::to_string(static_cast<int>(process[2])) + " at " + address;
}

/// To be called after ros::init and before the first NodeHandle. False, with a sentence on the
/// error output, where a living node has this name, also after 2 s, in which one that is being
/// started again may end.
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

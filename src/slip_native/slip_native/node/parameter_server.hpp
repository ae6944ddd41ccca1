/* The parameter services that every ROS node has, and `/parameter_events`. */
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "ros.hpp"
#include "session.hpp"

class ParameterServer {
 public:
  /* services: the parameter services are appended to it. */
  ParameterServer(ros::Node &ros, Session &session, std::vector<std::unique_ptr<ros::AnyService>> *services);

 private:
  std::string set(const rcl_interfaces__msg__Parameter *given, size_t count);

  Session &session_;
  std::string name_, full_name_;
  ros::Publisher<rcl_interfaces__msg__ParameterEvent> events_;
};

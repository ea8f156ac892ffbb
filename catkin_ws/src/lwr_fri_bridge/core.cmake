# The core of this package, without ROS, and its Python module. CMakeLists.txt includes this file after catkin_package();
# python/CMakeLists.txt uses it without catkin, and sets the folders that catkin would set.

find_package(Eigen3 REQUIRED)
find_package(Threads REQUIRED)
find_package(yaml-cpp REQUIRED)
find_package(pybind11 REQUIRED)

# One folder a room, which includes only those above it in this list.
add_library(lwr_fri_bridge
  src/fri/datagram.cpp
  src/fri/krl_convention.cpp
  src/fri/session.cpp
  src/fri/set_point_history.cpp
  src/requests/configurator.cpp
  src/requests/events.cpp
  src/requests/target_command.cpp
  src/motion/hand_guiding.cpp
  src/motion/set_point_leash.cpp
  src/motion/tool_frame.cpp
  src/motion/velocity_filter.cpp
  src/supervision/command_mode_loss.cpp
  src/supervision/supervisor.cpp
  src/bridge/bridge.cpp
  src/bridge/bridge_config.cpp
  src/bridge/diagnosis.cpp
  src/bridge/fri_thread.cpp)
target_compile_features(lwr_fri_bridge PUBLIC cxx_std_17)
target_compile_options(lwr_fri_bridge PRIVATE -Wall -Wextra -O2)
set_target_properties(lwr_fri_bridge PROPERTIES POSITION_INDEPENDENT_CODE ON)
target_include_directories(lwr_fri_bridge PUBLIC include ${coglab_rt_INCLUDE_DIRS} ${EIGEN3_INCLUDE_DIRS})
target_link_libraries(lwr_fri_bridge PUBLIC Threads::Threads yaml-cpp)

# Python binding: module lwr_fri_bridge.
pybind11_add_module(lwr_fri_bridge_python python/bindings.cpp)
set_target_properties(lwr_fri_bridge_python PROPERTIES
  OUTPUT_NAME lwr_fri_bridge
  LIBRARY_OUTPUT_DIRECTORY ${CATKIN_DEVEL_PREFIX}/${CATKIN_GLOBAL_PYTHON_DESTINATION})
target_link_libraries(lwr_fri_bridge_python PRIVATE lwr_fri_bridge)

install(TARGETS lwr_fri_bridge
  ARCHIVE DESTINATION ${CATKIN_PACKAGE_LIB_DESTINATION}
  LIBRARY DESTINATION ${CATKIN_PACKAGE_LIB_DESTINATION})
install(TARGETS lwr_fri_bridge_python LIBRARY DESTINATION ${CATKIN_GLOBAL_PYTHON_DESTINATION})

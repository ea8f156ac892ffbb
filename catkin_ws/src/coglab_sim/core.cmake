# The simulated cell and the robot in virtual time, without ROS, and their Python modules. CMakeLists.txt includes this file
# after catkin_package(); python/CMakeLists.txt uses it without catkin, and sets the folders that catkin would set.

find_package(Eigen3 REQUIRED)
# Not by kdl_parser's own configuration: it asks for the whole of ROS.
find_library(KDL_PARSER_LIBRARY kdl_parser REQUIRED)
find_package(orocos_kdl REQUIRED)
find_package(Threads REQUIRED)
find_package(urdfdom REQUIRED)
find_package(pybind11 REQUIRED)
find_package(yaml-cpp REQUIRED)
# Not by MuJoCo's own configuration: Debian's names an include folder of qhull that need not be there.
find_path(MUJOCO_INCLUDE_DIR mujoco/mujoco.h)
find_library(MUJOCO_LIBRARY mujoco)
if(NOT MUJOCO_INCLUDE_DIR OR NOT MUJOCO_LIBRARY)
  message(FATAL_ERROR "coglab_sim: the physics library MuJoCo is not there; install it: apt-get install libmujoco-dev")
endif()

# The table of the hand goes into the library, so that nothing needs a path to it.
set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/config/hand_model.yaml)
file(READ config/hand_model.yaml COGLAB_SIM_HAND_MODEL)
configure_file(src/plant/built_in_hand.cpp.in built_in_hand.cpp @ONLY)

# What has mass: arm, hand with fingers, object, the person's hand; by MuJoCo.
add_library(coglab_sim_plant
  ${CMAKE_CURRENT_BINARY_DIR}/built_in_hand.cpp
  src/plant/hand_motors.cpp
  src/plant/hand_table.cpp
  src/plant/hold_spring.cpp
  src/plant/model.cpp
  src/plant/model_writer.cpp
  src/plant/overlap.cpp
  src/plant/plant.cpp
  src/plant/robot_description.cpp
  src/ranges.cpp)
target_compile_features(coglab_sim_plant PUBLIC cxx_std_17)
target_compile_options(coglab_sim_plant PRIVATE -Wall -Wextra -O2)
set_target_properties(coglab_sim_plant PROPERTIES POSITION_INDEPENDENT_CODE ON)
target_include_directories(coglab_sim_plant PUBLIC include PRIVATE src/plant)
target_include_directories(coglab_sim_plant SYSTEM PUBLIC ${catkin_INCLUDE_DIRS} ${EIGEN3_INCLUDE_DIRS})
target_link_libraries(coglab_sim_plant PUBLIC ${MUJOCO_LIBRARY} PRIVATE tinyxml2 yaml-cpp)

# The cell without ROS.
add_library(coglab_sim
  src/arm_model.cpp
  src/cell.cpp
  src/cell_config.cpp
  src/fri_socket.cpp
  src/krc/answer_statistics.cpp
  src/krc/command_checks.cpp
  src/krc/controller.cpp
  src/krc/krl_program.cpp
  src/krc/servos.cpp
  src/pace.cpp
  src/palm_sensors.cpp
  src/real_time_cell.cpp
  src/torque_sensor.cpp)
target_compile_features(coglab_sim PUBLIC cxx_std_17)
target_compile_options(coglab_sim PRIVATE -Wall -Wextra -O2)
set_target_properties(coglab_sim PROPERTIES POSITION_INDEPENDENT_CODE ON)
target_include_directories(coglab_sim PUBLIC include)
target_include_directories(coglab_sim SYSTEM
  PUBLIC ${catkin_INCLUDE_DIRS} ${EIGEN3_INCLUDE_DIRS}
  PRIVATE ${urdfdom_INCLUDE_DIRS})
target_link_libraries(coglab_sim
  PUBLIC coglab_sim_plant orocos-kdl Threads::Threads
  PRIVATE ${KDL_PARSER_LIBRARY} urdfdom_model)

# Python binding: module coglab_sim._cell.
pybind11_add_module(coglab_sim_python python/cell_binding.cpp python/plant_binding.cpp)
set_target_properties(coglab_sim_python PROPERTIES
  OUTPUT_NAME _cell
  LIBRARY_OUTPUT_DIRECTORY ${CATKIN_DEVEL_PREFIX}/${CATKIN_PACKAGE_PYTHON_DESTINATION})
target_link_libraries(coglab_sim_python PRIVATE coglab_sim)

# The robot in virtual time: cell, bridge and controllers in one thread. Targets in one workspace build, files otherwise.
set(COGLAB_SIM_ROBOT "")
foreach(library coglab_controllers_plugins coglab_controllers_manager coglab_controllers_core ctrl_more lwr_fri_bridge)
  if(TARGET ${library})
    list(APPEND COGLAB_SIM_ROBOT ${library})
  else()
    find_library(COGLAB_SIM_${library} ${library} REQUIRED)
    list(APPEND COGLAB_SIM_ROBOT ${COGLAB_SIM_${library}})
  endif()
endforeach()
add_library(coglab_sim_virtual src/limit_watch.cpp src/virtual_robot.cpp)
target_compile_options(coglab_sim_virtual PRIVATE -Wall -Wextra -O2)
set_target_properties(coglab_sim_virtual PROPERTIES POSITION_INDEPENDENT_CODE ON)
target_link_libraries(coglab_sim_virtual PUBLIC coglab_sim ${COGLAB_SIM_ROBOT} yaml-cpp)
pybind11_add_module(coglab_sim_virtual_python python/python_motion.cpp python/virtual_binding.cpp)
set_target_properties(coglab_sim_virtual_python PROPERTIES
  OUTPUT_NAME _virtual
  LIBRARY_OUTPUT_DIRECTORY ${CATKIN_DEVEL_PREFIX}/${CATKIN_PACKAGE_PYTHON_DESTINATION})
target_link_libraries(coglab_sim_virtual_python PRIVATE coglab_sim_virtual ${catkin_LIBRARIES})

install(TARGETS coglab_sim coglab_sim_plant coglab_sim_virtual
  ARCHIVE DESTINATION ${CATKIN_PACKAGE_LIB_DESTINATION}
  LIBRARY DESTINATION ${CATKIN_PACKAGE_LIB_DESTINATION})
install(TARGETS coglab_sim_python coglab_sim_virtual_python LIBRARY DESTINATION ${CATKIN_PACKAGE_PYTHON_DESTINATION})

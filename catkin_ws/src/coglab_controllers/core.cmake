# The cores of this package, without ROS: DMP, inverse kinematics and limits (coglab_controllers_core), the controller
# manager, its plug-ins, the Python module and the tests of the first. CMakeLists.txt includes this file after
# catkin_package(); python/CMakeLists.txt uses it without catkin, and sets the folders that catkin would set.

find_package(Eigen3 REQUIRED NO_MODULE)
find_package(orocos_kdl REQUIRED)
# Not by kdl_parser's own configuration: it asks for the whole of ROS.
find_library(KDL_PARSER_LIBRARY kdl_parser REQUIRED)
find_package(urdfdom_headers REQUIRED)  # what the header of kdl_parser includes
find_library(COGLAB_TINYXML2_LIBRARY tinyxml2 REQUIRED)
find_package(pybind11 REQUIRED)
find_package(Threads REQUIRED)
find_package(yaml-cpp REQUIRED)

add_library(coglab_controllers_core
  src/dmp/cartesian_motion.cpp
  src/dmp/dmp.cpp
  src/dmp/dmp_request.cpp
  src/dmp/learning.cpp
  src/dmp/library.cpp
  src/dmp/library_xml.cpp
  src/dmp/orientation_curve.cpp
  src/dmp/primitive.cpp
  src/goal/goal_filter.cpp
  src/goal/goal_limits.cpp
  src/ik/second_task.cpp
  src/ik/two_task_ik.cpp
  src/kinematics/chain.cpp
  src/kinematics/dynamics.cpp
  src/kinematics/rotation.cpp
  src/limits/guard.cpp
  src/limits/phase_governor.cpp
  src/limits/workspace.cpp
  src/ptp/ptp_trajectory.cpp)
target_include_directories(coglab_controllers_core PUBLIC ${CMAKE_CURRENT_SOURCE_DIR}/include ${coglab_rt_INCLUDE_DIRS})
target_include_directories(coglab_controllers_core SYSTEM PUBLIC ${orocos_kdl_INCLUDE_DIRS}
  PRIVATE ${urdfdom_headers_INCLUDE_DIRS})
target_link_libraries(coglab_controllers_core
  PUBLIC Eigen3::Eigen ${orocos_kdl_LIBRARIES}
  PRIVATE ${KDL_PARSER_LIBRARY} ${COGLAB_TINYXML2_LIBRARY})
target_compile_features(coglab_controllers_core PUBLIC cxx_std_17)
target_compile_options(coglab_controllers_core PRIVATE -Wall -Wextra -O2)
set_target_properties(coglab_controllers_core PROPERTIES POSITION_INDEPENDENT_CODE ON)

if(TARGET ctrl_more)
  set(COGLAB_ctrl_more ctrl_more)
else()
  find_library(COGLAB_ctrl_more ctrl_more REQUIRED)
endif()

# Control cycle and controller manager, without ROS.
add_library(coglab_controllers_manager
  src/manager/control_cycle.cpp
  src/manager/control_thread.cpp
  src/manager/controller_manager.cpp
  src/manager/feedback_requests.cpp
  src/manager/feedback_stage.cpp
  src/manager/parameters.cpp
  src/manager/robot_setup.cpp
  src/manager/signal_file.cpp
  src/manager/signal_inputs.cpp
  src/manager/tunables.cpp)
target_compile_features(coglab_controllers_manager PUBLIC cxx_std_17)
target_compile_options(coglab_controllers_manager PRIVATE -Wall -Wextra -O2)
target_include_directories(coglab_controllers_manager
  PUBLIC ${CMAKE_CURRENT_SOURCE_DIR}/include ${ctrl_more_INCLUDE_DIRS} ${coglab_rt_INCLUDE_DIRS})
target_link_libraries(coglab_controllers_manager
  PUBLIC coglab_controllers_core ${COGLAB_ctrl_more} yaml-cpp Eigen3::Eigen
  PRIVATE Threads::Threads ${CMAKE_DL_LIBS})
set_target_properties(coglab_controllers_manager PROPERTIES POSITION_INDEPENDENT_CODE ON)

# Motions and the motion controllers, without ROS: usable from a program in virtual time.
add_library(coglab_controllers_plugins
  src/goal/goal_input.cpp
  src/motion/custom_motion_controller.cpp
  src/motion/hold.cpp
  src/motion/joint_spline.cpp
  src/motion/reference_loop.cpp
  src/plugins/dmp_controller.cpp
  src/plugins/dmp_cycle.cpp
  src/plugins/joint_trajectory.cpp
  src/plugins/ptp_controller.cpp
  src/plugins/stream_controller.cpp
  src/remote/slot.cpp)
target_compile_options(coglab_controllers_plugins PRIVATE -Wall -Wextra -O2)
target_link_libraries(coglab_controllers_plugins PUBLIC coglab_controllers_manager)
set_target_properties(coglab_controllers_plugins PROPERTIES POSITION_INDEPENDENT_CODE ON)

# The slots for Python processes: plug-ins that nobody links.
foreach(slot motion feedback)
  add_library(coglab_remote_${slot} MODULE src/remote/remote_${slot}.cpp)
  target_compile_options(coglab_remote_${slot} PRIVATE -Wall -Wextra)
  target_link_libraries(coglab_remote_${slot} PRIVATE coglab_controllers_plugins)
endforeach()
# The name by which Ctrl-MORE finds the type RemoteFeedback.
set_target_properties(coglab_remote_feedback PROPERTIES OUTPUT_NAME remote_feedback)

# Python module coglab_controllers._core, beside the Python files of src/coglab_controllers.
pybind11_add_module(coglab_controllers_python
  src/python/module.cpp
  src/python/bind_arm.cpp
  src/python/bind_dmp.cpp
  src/python/bind_limits.cpp
  src/python/bind_motion.cpp)
target_link_libraries(coglab_controllers_python PRIVATE coglab_controllers_core yaml-cpp)
set_target_properties(coglab_controllers_python PROPERTIES
  OUTPUT_NAME _core
  LIBRARY_OUTPUT_DIRECTORY ${CATKIN_DEVEL_PREFIX}/${CATKIN_PACKAGE_PYTHON_DESTINATION})

install(TARGETS coglab_controllers_core coglab_controllers_manager coglab_controllers_plugins
    coglab_remote_motion coglab_remote_feedback
  ARCHIVE DESTINATION ${CATKIN_PACKAGE_LIB_DESTINATION}
  LIBRARY DESTINATION ${CATKIN_PACKAGE_LIB_DESTINATION}
  RUNTIME DESTINATION ${CATKIN_GLOBAL_BIN_DESTINATION})
install(TARGETS coglab_controllers_python LIBRARY DESTINATION ${CATKIN_PACKAGE_PYTHON_DESTINATION})
install(FILES src/coglab_controllers/_core.pyi src/coglab_controllers/py.typed
  DESTINATION ${CATKIN_PACKAGE_PYTHON_DESTINATION})
install(FILES config/primitives.xml config/primitives_recorded.xml
  DESTINATION ${CATKIN_PACKAGE_SHARE_DESTINATION}/config)

# Each folder of test/ is one binary. test_allocation counts the calls of malloc.
if(CATKIN_ENABLE_TESTING)
  foreach(room allocation dmp kinematics)
    file(GLOB sources CONFIGURE_DEPENDS test/${room}/*.cpp)
    catkin_add_gtest(coglab_controllers_test_${room} ${sources})
    if(TARGET coglab_controllers_test_${room})
      target_link_libraries(coglab_controllers_test_${room} coglab_controllers_core yaml-cpp gtest_main gtest)
      target_include_directories(coglab_controllers_test_${room} PRIVATE ${coglab_rt_INCLUDE_DIRS} test)
      target_compile_definitions(coglab_controllers_test_${room} PRIVATE
        COGLAB_PACKAGE_DIR="${CMAKE_CURRENT_SOURCE_DIR}")
    endif()
  endforeach()
endif()

# The detectors in the torques of the arm, without ROS, and their Python module coglab_contact._core. CMakeLists.txt includes
# this file.

find_package(Eigen3 REQUIRED NO_MODULE)
find_package(pybind11 REQUIRED)

add_library(coglab_contact
  src/contact_detector.cpp
  src/evidence.cpp
  src/momentum_observer.cpp
  src/motion_thresholds.cpp
  src/moving_contact.cpp)
target_compile_features(coglab_contact PUBLIC cxx_std_17)
target_compile_options(coglab_contact PRIVATE -Wall -Wextra -O2)
set_target_properties(coglab_contact PROPERTIES POSITION_INDEPENDENT_CODE ON)
target_include_directories(coglab_contact PUBLIC ${CMAKE_CURRENT_SOURCE_DIR}/include)
target_link_libraries(coglab_contact PUBLIC Eigen3::Eigen)

# The module uses the chain and the dynamics of coglab_controllers: a target in one workspace build, a file otherwise.
if(TARGET coglab_controllers_core)
  set(COGLAB_CONTACT_controllers coglab_controllers_core)
else()
  find_library(COGLAB_CONTACT_controllers coglab_controllers_core REQUIRED)
  find_package(orocos_kdl REQUIRED)
endif()
pybind11_add_module(coglab_contact_python python/core_binding.cpp)
set_target_properties(coglab_contact_python PROPERTIES
  OUTPUT_NAME _core
  LIBRARY_OUTPUT_DIRECTORY ${CATKIN_DEVEL_PREFIX}/${CATKIN_PACKAGE_PYTHON_DESTINATION})
target_include_directories(coglab_contact_python SYSTEM PRIVATE ${catkin_INCLUDE_DIRS} ${orocos_kdl_INCLUDE_DIRS})
target_link_libraries(coglab_contact_python PRIVATE coglab_contact ${COGLAB_CONTACT_controllers})

install(TARGETS coglab_contact
  ARCHIVE DESTINATION ${CATKIN_PACKAGE_LIB_DESTINATION}
  LIBRARY DESTINATION ${CATKIN_PACKAGE_LIB_DESTINATION})
install(TARGETS coglab_contact_python LIBRARY DESTINATION ${CATKIN_PACKAGE_PYTHON_DESTINATION})

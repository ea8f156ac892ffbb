# The library of this package, without ROS, and its Python module. CMakeLists.txt includes this file after catkin_package();
# python/CMakeLists.txt uses it without catkin, and sets the folders that catkin would set.

find_package(Eigen3 REQUIRED)
find_package(pybind11 REQUIRED)

add_library(coglab_perception src/minimum_jerk.cpp src/reach_bank.cpp)
target_compile_features(coglab_perception PUBLIC cxx_std_17)
target_compile_options(coglab_perception PRIVATE -Wall -Wextra -O2)
set_target_properties(coglab_perception PROPERTIES POSITION_INDEPENDENT_CODE ON)
target_include_directories(coglab_perception PUBLIC include)
target_include_directories(coglab_perception SYSTEM PUBLIC ${EIGEN3_INCLUDE_DIRS})

# Python binding: module coglab_perception._reach_bank.
pybind11_add_module(coglab_perception_python python/reach_bank_binding.cpp)
set_target_properties(coglab_perception_python PROPERTIES
  OUTPUT_NAME _reach_bank
  LIBRARY_OUTPUT_DIRECTORY ${CATKIN_DEVEL_PREFIX}/${CATKIN_PACKAGE_PYTHON_DESTINATION})
target_link_libraries(coglab_perception_python PRIVATE coglab_perception)

install(TARGETS coglab_perception
  ARCHIVE DESTINATION ${CATKIN_PACKAGE_LIB_DESTINATION}
  LIBRARY DESTINATION ${CATKIN_PACKAGE_LIB_DESTINATION})
install(TARGETS coglab_perception_python LIBRARY DESTINATION ${CATKIN_PACKAGE_PYTHON_DESTINATION})

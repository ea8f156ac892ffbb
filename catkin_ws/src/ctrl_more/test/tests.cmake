# Tests, the same for catkin and plain CMake.
if(NOT COMMAND catkin_add_gtest)
  enable_testing()
  find_package(GTest REQUIRED)
endif()

function(ctrl_more_add_test name)
  set(target ctrl_more_test_${name})
  if(COMMAND catkin_add_gtest)
    catkin_add_gtest(${target} ${ARGN})
  else()
    add_executable(${target} ${ARGN})
    target_link_libraries(${target} GTest::gtest_main)
    add_test(NAME ${target} COMMAND ${target})
  endif()
  if(NOT TARGET ${target})
    return()
  endif()
  target_link_libraries(${target} ctrl_more Threads::Threads)
  target_include_directories(${target} PRIVATE test src controllers)
  target_compile_features(${target} PRIVATE cxx_std_17)
  target_compile_definitions(${target} PRIVATE
    CTRL_MORE_SOURCE_DIR="${CMAKE_CURRENT_SOURCE_DIR}"
    CTRL_MORE_TEST_PLUGIN_DIR="${CMAKE_CURRENT_BINARY_DIR}/test_plugins"
    CTRL_MORE_PLUGIN_DIR="$<TARGET_FILE_DIR:ctrl_more_attitude>")
endfunction()

ctrl_more_add_test(states test/test_robot_states.cpp test/test_control_states.cpp)
ctrl_more_add_test(manager test/test_feedback_controller.cpp test/test_manager.cpp)
ctrl_more_add_test(isolation test/test_isolation.cpp test/test_blending.cpp)

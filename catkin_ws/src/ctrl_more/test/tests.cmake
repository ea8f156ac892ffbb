# Tests, the same for catkin and plain CMake.
if(NOT COMMAND catkin_add_gtest)
  enable_testing()
  find_package(GTest REQUIRED)
endif()

function(ctrl_more_add_test name)
  set(target ctrl_more_test_${name})
  if(COMMAND catkin_add_gtest)
    catkin_add_gtest(${target} ${ARGN} test/run_tests.cpp)
  else()
    add_executable(${target} ${ARGN} test/run_tests.cpp)
    target_link_libraries(${target} GTest::gtest)
    add_test(NAME ${target} COMMAND ${target})
  endif()
  if(NOT TARGET ${target})
    return()
  endif()
  target_link_libraries(${target} ctrl_more Threads::Threads)
  target_include_directories(${target} PRIVATE test src controllers)
  target_compile_features(${target} PRIVATE cxx_std_17)
  target_compile_definitions(${target} PRIVATE
    EIGEN_NO_DEBUG  # as in a release build, where Eigen checks nothing
    CTRL_MORE_SOURCE_DIR="${CMAKE_CURRENT_SOURCE_DIR}"
    CTRL_MORE_TEST_PLUGIN_DIR="${CMAKE_CURRENT_BINARY_DIR}/test_plugins"
    CTRL_MORE_PLUGIN_DIR="$<TARGET_FILE_DIR:ctrl_more_attitude>")
endfunction()

# Libraries that a manager must cope with.
foreach(plugin good none two again paper_maker unresolved throwing wrong_type other_abi
    strangers rebuilt static_object resident)
  set(source ${plugin})
  if(plugin STREQUAL resident)
    set(source good)
  endif()
  add_library(ctrl_more_test_plugin_${plugin} SHARED EXCLUDE_FROM_ALL test/plugins/${source}.cpp)
  target_link_libraries(ctrl_more_test_plugin_${plugin} PRIVATE ctrl_more)
  set_target_properties(ctrl_more_test_plugin_${plugin} PROPERTIES
    OUTPUT_NAME ${plugin}
    LIBRARY_OUTPUT_DIRECTORY ${CMAKE_CURRENT_BINARY_DIR}/test_plugins)
  list(APPEND CTRL_MORE_TEST_PLUGINS ctrl_more_test_plugin_${plugin})
  add_dependencies(ctrl_more_test_plugin_${plugin} ctrl_more_probe)
endforeach()

# One that the dynamic linker never closes.
target_link_options(ctrl_more_test_plugin_resident PRIVATE -Wl,-z,nodelete)

# One program per file, named after it: the test runner looks for them.
foreach(name robot_states control_states feedback_controller manager by_signal gains cascade
    all_or_nothing isolation limits letting_go overruns attribution blending corrections exchanges
    plugins list_file search_path describe_tool documentation description settings config
    config_fuzz logger central_module attitude compliant_stabiliser zmp_dcm ee_admittance
    joint_limits three_robots abi controller_logs)
  ctrl_more_add_test(${name} test/test_${name}.cpp)
endforeach()
ctrl_more_add_test(realtime test/test_realtime.cpp test/forbidden_calls.cpp)
foreach(name plugins list_file describe_tool all_or_nothing config_fuzz central_module)
  if(TARGET ctrl_more_test_${name})
    add_dependencies(ctrl_more_test_${name} ${CTRL_MORE_TEST_PLUGINS})
  endif()
endforeach()
foreach(name plugins search_path describe_tool documentation central_module attitude
    compliant_stabiliser zmp_dcm ee_admittance joint_limits three_robots controller_logs realtime)
  if(TARGET ctrl_more_test_${name})
    add_dependencies(ctrl_more_test_${name} ${CTRL_MORE_PLUGINS})
  endif()
endforeach()
# Programs that a test runs, wherever catkin or plain CMake puts them: a missing one makes it red.
if(TARGET ctrl_more_test_describe_tool)
  add_dependencies(ctrl_more_test_describe_tool ctrl_more_describe)
  target_compile_definitions(ctrl_more_test_describe_tool PRIVATE
    CTRL_MORE_DESCRIBE="$<TARGET_FILE:ctrl_more_describe>")
endif()
if(TARGET ctrl_more_test_central_module)
  add_dependencies(ctrl_more_test_central_module ctrl_more_attitude_example)
  target_compile_definitions(ctrl_more_test_central_module PRIVATE
    CTRL_MORE_EXAMPLE="$<TARGET_FILE:ctrl_more_attitude_example>")
endif()
if(TARGET ctrl_more_test_realtime)
  target_link_libraries(ctrl_more_test_realtime ${CMAKE_DL_LIBS})
endif()

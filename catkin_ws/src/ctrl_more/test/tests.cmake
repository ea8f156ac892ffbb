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
    CTRL_MORE_SOURCE_DIR="${CMAKE_CURRENT_SOURCE_DIR}"
    CTRL_MORE_TEST_PLUGIN_DIR="${CMAKE_CURRENT_BINARY_DIR}/test_plugins"
    CTRL_MORE_PLUGIN_DIR="$<TARGET_FILE_DIR:ctrl_more_attitude>")
endfunction()

# Libraries that a manager must cope with.
foreach(plugin good none two again paper_maker unresolved throwing wrong_type)
  add_library(ctrl_more_test_plugin_${plugin} SHARED EXCLUDE_FROM_ALL test/plugins/${plugin}.cpp)
  target_link_libraries(ctrl_more_test_plugin_${plugin} PRIVATE ctrl_more)
  set_target_properties(ctrl_more_test_plugin_${plugin} PROPERTIES
    OUTPUT_NAME ${plugin}
    LIBRARY_OUTPUT_DIRECTORY ${CMAKE_CURRENT_BINARY_DIR}/test_plugins)
  list(APPEND CTRL_MORE_TEST_PLUGINS ctrl_more_test_plugin_${plugin})
endforeach()

ctrl_more_add_test(states test/test_robot_states.cpp test/test_control_states.cpp)
ctrl_more_add_test(manager test/test_feedback_controller.cpp test/test_manager.cpp)
ctrl_more_add_test(isolation test/test_isolation.cpp test/test_blending.cpp)
ctrl_more_add_test(plugins test/test_plugins.cpp test/test_documentation.cpp)
ctrl_more_add_test(config test/test_config.cpp test/test_config_fuzz.cpp)
ctrl_more_add_test(logger test/test_logger.cpp)
ctrl_more_add_test(central_module test/test_central_module.cpp)
ctrl_more_add_test(controllers
  test/test_attitude.cpp test/test_compliant_stabiliser.cpp test/test_zmp_dcm.cpp
  test/test_ee_admittance.cpp test/test_joint_limits.cpp test/test_three_robots.cpp)
ctrl_more_add_test(realtime test/test_realtime.cpp test/forbidden_calls.cpp)
foreach(name plugins config central_module)
  if(TARGET ctrl_more_test_${name})
    add_dependencies(ctrl_more_test_${name} ${CTRL_MORE_TEST_PLUGINS})
  endif()
endforeach()
foreach(name plugins config central_module controllers realtime)
  if(TARGET ctrl_more_test_${name})
    add_dependencies(ctrl_more_test_${name} ${CTRL_MORE_PLUGINS})
  endif()
endforeach()
if(TARGET ctrl_more_test_realtime)
  target_link_libraries(ctrl_more_test_realtime ${CMAKE_DL_LIBS})
endif()

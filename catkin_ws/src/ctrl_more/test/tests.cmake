# Tests, the same for catkin and plain CMake: one program per folder test/ROOM.
if(NOT COMMAND catkin_add_gtest)
  enable_testing()
  find_package(GTest REQUIRED)
endif()

# Libraries that a manager must cope with.
foreach(plugin good none two again paper_maker unresolved throwing wrong_type other_abi
    strangers rebuilt static_object resident walk)
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

foreach(room states description loading manager controllers memory realtime)
  set(target ctrl_more_test_${room})
  file(GLOB sources CONFIGURE_DEPENDS test/${room}/*.cpp)
  if(COMMAND catkin_add_gtest)
    catkin_add_gtest(${target} ${sources} test/run_tests.cpp)
  else()
    add_executable(${target} ${sources} test/run_tests.cpp)
    target_link_libraries(${target} GTest::gtest)
    add_test(NAME ${target} COMMAND ${target})
  endif()
  if(NOT TARGET ${target})
    continue()
  endif()
  target_link_libraries(${target} ctrl_more Threads::Threads ${CMAKE_DL_LIBS})
  target_include_directories(${target} PRIVATE test src controllers)
  target_compile_features(${target} PRIVATE cxx_std_17)
  # EIGEN_NO_DEBUG: as in a release build, where Eigen checks nothing.
  target_compile_definitions(${target} PRIVATE
    EIGEN_NO_DEBUG
    CTRL_MORE_SOURCE_DIR="${CMAKE_CURRENT_SOURCE_DIR}"
    CTRL_MORE_TEST_PLUGIN_DIR="${CMAKE_CURRENT_BINARY_DIR}/test_plugins"
    CTRL_MORE_PLUGIN_DIR="$<TARGET_FILE_DIR:ctrl_more_attitude>"
    CTRL_MORE_DESCRIBE="$<TARGET_FILE:ctrl_more_describe>"
    CTRL_MORE_EXAMPLE="$<TARGET_FILE:ctrl_more_attitude_example>")
  add_dependencies(${target} ctrl_more_describe ctrl_more_attitude_example ${CTRL_MORE_PLUGINS}
    ${CTRL_MORE_TEST_PLUGINS})
endforeach()
# It defines functions of the C library, which no other file may see.
if(TARGET ctrl_more_test_realtime)
  set_target_properties(ctrl_more_test_realtime PROPERTIES UNITY_BUILD OFF)
endif()

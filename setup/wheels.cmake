# CMake toolchain file for ROS 2 from wheels, named by the environment variable CMAKE_TOOLCHAIN_FILE. Needs CMake 3.24.
#
# The export files of the message wheels list include directories of the machine that built them (/opt/python/...), and
# CMake refuses to generate when they do not exist here. This drops them from the imported targets of a project, after
# its last line and before generation, so neither the installed wheels nor any CMakeLists.txt has to change.
set(CMAKE_PROJECT_TOP_LEVEL_INCLUDES "${CMAKE_CURRENT_LIST_DIR}/wheels_paths.cmake")

# The wheels bring no rclcpp: the C++ side of the interfaces, a third of the building time, would have no user.
set(HINDRAX_NO_CPP_INTERFACES ON)

"""The ROS side of the console: state of the robot, commands, STOP, and the node."""

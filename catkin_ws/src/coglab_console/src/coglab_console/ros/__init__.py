"""The robot as ROS tells it, commands and STOP as ROS takes them, and the node."""

"""The experimenter's console. The core (everything but ros_*.py) knows no ROS."""

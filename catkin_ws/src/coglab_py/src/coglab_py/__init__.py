"""Common code of CogLab's Python packages: poses, checked YAML files, checked ROS parameters."""

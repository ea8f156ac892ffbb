"""Code that the Python packages of CogLab share: poses, checked YAML files, checked ROS parameters."""

"""What the console does without ROS and without a web library: commands, who may, why not, sessions, events."""

"""The experimenter's console. `desk`, `web`, `scene`: without ROS. `ros`: joins them to ROS. `browser`: for tests."""

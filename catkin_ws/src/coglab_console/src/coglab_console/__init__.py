"""The experimenter's console. `desk`, `web`, `scene`: without ROS. `ros`: their connection to ROS. `browser`: for tests."""

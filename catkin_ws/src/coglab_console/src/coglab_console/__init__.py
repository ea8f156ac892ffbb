"""The experimenter's console. `desk`, `web` and `scene` know no ROS; `ros` ties them to it; `browser` is for tests."""

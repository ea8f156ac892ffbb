"""The experimenter's console. `desk`, `web` and `scene` need no ROS; `ros` connects them to it; `browser` is for tests."""

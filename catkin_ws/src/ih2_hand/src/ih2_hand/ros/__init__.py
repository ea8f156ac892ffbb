"""The ROS side of the hand: thin nodes over the driver and the emulator."""

"""Python side of the simulated cell: the virtual human and the perception stand-in. No ROS client library in here."""

"""The console's logic without ROS and web library: commands, operator, reasons of refusals, sessions, events."""

"""Ports that use ROS services, actions and topics."""

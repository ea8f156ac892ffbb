"""Ports over services, actions and topics."""

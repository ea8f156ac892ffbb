"""Own controllers in Python, for the virtual world and for the running robot."""

"""Contact, load and release from joint torques."""

"""Contact, load and release, from torques, fingers, touch and sight."""

"""Detection of contact, load and release from joint torques, finger motors, touch and sight."""

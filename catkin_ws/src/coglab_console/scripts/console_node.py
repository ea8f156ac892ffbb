#!/usr/bin/python3
"""The node /coglab_console: the experimenter's page. It shows and triggers; it never decides.

Private parameters: address (default 127.0.0.1), port (default 8790; 0: any free one; where the default is taken, the
next free one), hosts (further accepted values of the HTTP header Host, for a tunnel with another port), real (true on
hardware), sessions (folder of session.json, the state of the open session; default console_sessions in ROS_HOME).
The link with its one-time token is printed and written to console.url in ROS_HOME, readable by this user alone.
"""

import sys

from coglab_console.ros.node import main

if __name__ == "__main__":
    sys.exit(main())

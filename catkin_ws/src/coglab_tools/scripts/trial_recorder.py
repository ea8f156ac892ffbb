#!/usr/bin/python3
"""The node /trial_recorder: records every handover into its own folder, with the seconds before it."""

import sys

from coglab_tools.trial.recorder_node import main

if __name__ == "__main__":
    sys.exit(main())

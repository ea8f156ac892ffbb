#!/usr/bin/python3
"""The node /trial_recorder; see coglab_tools.trial.recorder."""

import sys

from coglab_tools.trial.recorder import main

if __name__ == "__main__":
    sys.exit(main())

"""The state machines of D4.10 Figures 3-8, built from the leaf states."""

from coglab_smach.machines.master import build_master

__all__ = ["build_master"]

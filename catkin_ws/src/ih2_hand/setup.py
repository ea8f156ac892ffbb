"""Lets catkin install the Python package."""

from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import setup

setup(**generate_distutils_setup(packages=["ih2_hand", "ih2_hand.emulator", "ih2_hand.ros"], package_dir={"": "src"}))

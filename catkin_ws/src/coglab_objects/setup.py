"""Python package of coglab_objects, installed by catkin."""

from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import setup

setup(**generate_distutils_setup(packages=["coglab_objects"], package_dir={"": "src"}))

"""Python package of coglab_perception, installed by catkin."""

from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import setup

setup(**generate_distutils_setup(packages=["coglab_perception"], package_dir={"": "src"}))

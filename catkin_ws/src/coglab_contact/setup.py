"""Python package of coglab_contact, installed by catkin."""

from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import setup

setup(**generate_distutils_setup(packages=["coglab_contact"], package_dir={"": "src"}))

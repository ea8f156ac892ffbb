"""Python part of the package, installed by catkin_python_setup(); the compiled module is built by core.cmake."""

from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import setup

setup(**generate_distutils_setup(packages=["coglab_controllers"], package_dir={"": "src"}))

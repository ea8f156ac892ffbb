"""Python part of the package, installed by catkin_python_setup(); CMakeLists.txt builds the compiled module."""

from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import setup

setup(**generate_distutils_setup(packages=["ctrl_more"], package_dir={"": "src"}))

"""Python package of coglab, installed by catkin."""

from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import setup

setup(
    **generate_distutils_setup(packages=["coglab", "coglab.control", "coglab.envs"], package_dir={"": "src"}),
)

"""Python package of coglab_console, installed by catkin."""

from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import setup

setup(
    **generate_distutils_setup(
        packages=["coglab_console", *(f"coglab_console.{door}" for door in ("desk", "web", "scene", "ros"))],
        package_dir={"": "src"},
    )
)

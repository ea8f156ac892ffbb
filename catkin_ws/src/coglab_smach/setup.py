"""Python package of coglab_smach, installed by catkin."""
from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import setup

setup(**generate_distutils_setup(
    packages=["coglab_smach", "coglab_smach.states", "coglab_smach.machines"],
    package_dir={"": "src"},
    package_data={"coglab_smach": ["machines_schema.json"]}))

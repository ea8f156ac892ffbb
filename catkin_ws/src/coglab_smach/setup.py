"""Python package of coglab_smach, installed by catkin."""

from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import setup

setup(
    **generate_distutils_setup(
        packages=[
            "coglab_smach",
            *(
                f"coglab_smach.{door}"
                for door in (
                    "clocks",
                    "kinematics",
                    "ports",
                    "context",
                    "states",
                    "machines",
                    "ros",
                )
            ),
        ],
        package_dir={"": "src"},
    )
)

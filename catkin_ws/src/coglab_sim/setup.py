from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import setup

setup(
    **generate_distutils_setup(
        packages=["coglab_sim", "coglab_sim.person", "coglab_sim.tracker"], package_dir={"": "src"}
    )
)

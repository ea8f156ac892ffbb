"""A file name with a space reaches the hand emulator whole."""

import roslaunch.config
import roslaunch.node_args
from coglab_py.packages import package_path


def test_a_trace_file_in_a_folder_with_a_space():
    launch = str(package_path("coglab_bringup", "launch", "coglab.launch"))
    given = ["hand_trace:=/a folder/t.txt", "console:=false"]
    config = roslaunch.config.load_config_default([(launch, given)], 11311, verbose=False, assign_machines=False)
    (emulator,) = (node for node in config.nodes if node.name == "hand_emulator")
    words = roslaunch.node_args.shlex.split(emulator.args)
    assert words[words.index("--trace") + 1] == "/a folder/t.txt"

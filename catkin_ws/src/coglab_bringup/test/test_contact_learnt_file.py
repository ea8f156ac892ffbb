"""`contact_learnt_file:=FILE`: where the contact detector writes what it learns of the arm's motions, and reads it."""

import pytest
import rospkg
from roslaunch.config import load_config_default

LAUNCHES = (
    ("coglab_smach", "coglab_smach.launch"),
    ("coglab_bringup", "coglab.launch"),
    ("coglab_bringup", "real.launch"),
)
NEEDED = {"coglab_smach.launch": ["dmp_library:=none.xml"]}


def learnt_file(package, file, *arguments):
    """The parameter that a launch file sets."""
    path = f"{rospkg.RosPack().get_path(package)}/launch/{file}"
    loaded = load_config_default([(path, [*arguments, *NEEDED.get(file, [])])], None)
    return loaded.params["/contact_detector/learnt_file"].value


@pytest.mark.parametrize("package, file", LAUNCHES)
def test_the_file_reaches_the_node(package, file):
    assert learnt_file(package, file, "contact_learnt_file:=learnt.yaml") == "learnt.yaml"


@pytest.mark.parametrize("package, file", LAUNCHES)
def test_by_default_nothing_is_learnt(package, file):
    assert learnt_file(package, file) == ""

"""Search order for files of packages, and the error for missing ones."""

import pytest
import rospkg
from coglab_py import packages
from coglab_py.packages import package_path


@pytest.fixture
def rospack(monkeypatch):
    """Paths known to rospack, by package; empty at first."""
    known = {}

    class RosPack:
        def get_path(self, package):
            if package not in known:
                raise rospkg.ResourceNotFound(package)
            return known[package]

    monkeypatch.setattr(rospkg, "RosPack", RosPack)
    return known


def placed(folder):
    (folder / "config").mkdir(parents=True)
    (folder / "config" / "f.yaml").write_text("")
    return folder / "config" / "f.yaml"


def test_beside_this_package(rospack):
    found = package_path("coglab_py", "package.xml")
    assert found.is_file() and found.parent.name == "coglab_py"


def test_in_the_share_folder_of_an_install_space(rospack, monkeypatch, tmp_path):
    monkeypatch.setattr(packages, "__file__", str(tmp_path / "lib" / "python3" / "coglab_py" / "packages.py"))
    file = placed(tmp_path / "share" / "ours")
    assert package_path("ours", "config", "f.yaml") == file
    assert package_path("ours") == tmp_path / "share" / "ours"


def test_through_rospack_if_it_is_in_no_other_place(rospack, tmp_path):
    file = placed(tmp_path / "elsewhere")
    rospack["far_away"] = str(tmp_path / "elsewhere")
    assert package_path("far_away", "config", "f.yaml") == file


def test_a_missing_file_or_package_is_named_with_a_remedy(rospack, tmp_path):
    placed(tmp_path / "elsewhere")
    rospack["far_away"] = str(tmp_path / "elsewhere")
    with pytest.raises(FileNotFoundError) as error:
        package_path("far_away", "config", "g.yaml")
    assert f"{tmp_path}/elsewhere/config/g.yaml" in str(error.value) and "far_away" in str(error.value)
    with pytest.raises(FileNotFoundError) as error:
        package_path("no_such_package", "config", "f.yaml")
    assert "no_such_package/config/f.yaml" in str(error.value)

"""Pictures of the cell without a screen. Skipped if the camera is not built: ./coglab film builds it."""

import numpy as np
import pytest
from coglab_py.packages import package_path
from coglab_sim import _cell

Camera = pytest.importorskip("coglab_sim._camera", reason="built by ./coglab film alone").Camera
URDF = str(package_path("lwr_description", "urdf", "lwr_ih2.urdf"))
RED = (0.9, 0.1, 0.1)


def looking_at_the_object():
    """A camera 0.5 m from a mug that lies in front of the robot."""
    cell = _cell.Cell(URDF, {"object/start": "world", "object/position": [0.8, 0.0, 0.4]})
    camera = Camera(cell, 160, 120)
    camera.set_colour("object", RED)
    camera.look([0.8, 0.0, 0.45], 0.5, -90.0, 0.0)
    return camera


def test_the_object_is_seen_where_it_is():
    camera = looking_at_the_object()
    picture = camera.draw()
    assert picture.shape == (120, 160, 3)
    red = (picture[..., 0] > 100) & (picture[..., 1] < 60)
    assert red[60, 80] and 0.02 < red.mean() < 0.5
    assert camera.depth()[60, 80] == pytest.approx(0.46, abs=0.01)  # m, to the near side of a mug of 0.08 m


def test_added_solids_are_in_one_picture_only():
    camera = looking_at_the_object()
    camera.add("sphere", [0.1, 0.0, 0.0], [0.8, 0.2, 0.45], [0.0, 0.0, 0.0, 1.0], (0.1, 0.1, 0.9))
    with_sphere, without = camera.draw().copy(), camera.draw()
    assert with_sphere[60, 80, 2] > with_sphere[60, 80, 0] and without[60, 80, 0] > without[60, 80, 2]
    assert np.isfinite(camera.depth()).all()


def test_what_cannot_be_drawn_is_refused():
    camera = looking_at_the_object()
    with pytest.raises(ValueError, match="no body 'moon'"):
        camera.set_colour("moon", RED)
    with pytest.raises(ValueError, match="shape 'cone'"):
        camera.add("cone", [0.1, 0.1, 0.1], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0], RED)

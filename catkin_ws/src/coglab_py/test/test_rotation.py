"""Our Rotation agrees with that of scipy."""

import numpy as np
import pytest
import scipy.spatial.transform
from coglab_py.rotation import Rotation


def pairs(count=200):
    """Random rotations, ours and scipy's: any size, tiny ones, and near half a turn."""
    rng = np.random.default_rng(1)
    for size in (1.0, 1e-3, 1e-5, 3.1):
        for _ in range(count):
            vector = rng.normal(size=3)
            vector *= size / (1.0 if size < 3.0 else np.linalg.norm(vector))
            theirs = scipy.spatial.transform.Rotation
            yield Rotation.from_rotvec(vector), theirs.from_rotvec(vector), rng.normal(size=(2, 3))


def test_every_method_agrees_with_scipy():
    exact = {"rel": 1e-14, "abs": 1e-15}
    before, before_theirs = Rotation.identity(), scipy.spatial.transform.Rotation.identity()
    for ours, theirs, points in pairs():
        assert ours.as_quat() == pytest.approx(theirs.as_quat(), **exact)
        assert ours.as_rotvec() == pytest.approx(theirs.as_rotvec(), **exact)
        assert ours.as_matrix() == pytest.approx(theirs.as_matrix(), **exact)
        assert ours.magnitude() == pytest.approx(theirs.magnitude(), **exact)
        assert ours.apply(points[0]) == pytest.approx(theirs.apply(points[0]), **exact)
        assert ours.apply(points) == pytest.approx(theirs.apply(points), rel=1e-12, abs=1e-14)
        assert ours.inv().apply(points[0]) == pytest.approx(theirs.inv().apply(points[0]), **exact)
        both, both_theirs = before * ours, before_theirs * theirs
        assert both.as_quat() == pytest.approx(both_theirs.as_quat(), **exact)
        before, before_theirs = ours, theirs


def test_a_quaternion_may_have_any_length_except_zero():
    assert Rotation.from_quat([0, 0, 3, 0]).as_quat().tolist() == [0.0, 0.0, 1.0, 0.0]
    with pytest.raises(ValueError, match="no direction"):
        Rotation.from_quat(np.zeros(4))

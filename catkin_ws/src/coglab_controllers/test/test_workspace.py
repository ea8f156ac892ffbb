"""Allowed positions of the workspace, and the projection of goals outside it."""

from __future__ import annotations

import coglab_controllers as cc
import numpy as np


def test_the_workspace_takes_its_faces_and_projects_to_what_is_allowed() -> None:
    workspace = cc.Workspace()
    for face in (
        [1.2, 0, 1],
        [-1.2, 0, 1],
        [0, 1.2, 1],
        [0, -1.2, 1],
        [0.5, 0, 0.0],
        [0.5, 0, 1.6],
        [0.25, 0, 0.2],
        [0, 0, 0.45],
    ):
        assert workspace.violated(face).startswith("inside") and workspace.contains(face)
        np.testing.assert_array_equal(workspace.project(face), face)
    for point, border in (
        ([1.2001, 0, 1], "upper"),
        ([0, -1.2001, 1], "lower"),
        ([0.5, 0, -0.001], "lower"),
        ([0.5, 0, 1.601], "upper"),
        ([0.2499, 0, 0.2], "sphere"),
    ):
        assert workspace.violated(point).startswith(border) and not workspace.contains(point)
    np.testing.assert_allclose(workspace.project([5, -5, 1]), [1.2, -1.2, 1])
    np.testing.assert_allclose(workspace.project([0.1, 0.0, 0.2]), [0.25, 0.0, 0.2], atol=1e-8)
    np.testing.assert_allclose(workspace.project([0.0, 0.06, 0.28]), [0.0, 0.15, 0.4], atol=1e-8)
    np.testing.assert_allclose(workspace.project([0.0, 0.0, 0.2]), [0.25, 0.0, 0.2], atol=1e-8)
    everywhere = cc.Workspace(cc.WorkspaceParameters(base_radius=0.0))
    np.testing.assert_array_equal(everywhere.project([0.0, 0.0, 0.2]), [0.0, 0.0, 0.2])

"""The axis of prisms, cones and pyramids, against where they were made."""

import numpy as np
import pytest

from texbake.mapping.classical.cylindrical import center_about_axis
from texbake.mapping.classical.frames import center_of, frame_about
from texbake.mesh.mesh import Mesh
from texbake.mesh.shapes import icosphere, plane


def prism(sides: int, *, tip: bool = False) -> Mesh:
    """Return a prism or a pyramid about the y axis, with radius 2, from y = 0 to 3."""
    angles = 0.1 + 2.0 * np.pi * np.arange(sides) / sides
    ring = np.stack([2.0 * np.sin(angles), np.zeros(sides), 2.0 * np.cos(angles)], axis=1)
    near, far = np.arange(sides), (np.arange(sides) + 1) % sides
    if tip:
        faces = np.stack([near, far, np.full(sides, sides)], axis=1)
        return Mesh(positions=np.vstack([ring, [[0.0, 3.0, 0.0]]]), faces=faces)
    lower = np.stack([near, far, far + sides], axis=1)
    upper = np.stack([near, far + sides, near + sides], axis=1)
    return Mesh(
        positions=np.vstack([ring, ring + np.array([0.0, 3.0, 0.0])]),
        faces=np.vstack([lower, upper]),
    )


@pytest.mark.parametrize("axis", ["y", (1.0, 2.0, -0.5)])
@pytest.mark.parametrize("tip", [False, True])
@pytest.mark.parametrize("sides", [3, 4, 5, 7, 33, 101])
def test_the_axis_of_a_prism_runs_through_its_middle(sides: int, tip: bool, axis: object) -> None:
    frame = frame_about(axis)  # type: ignore[arg-type]
    upright = prism(sides, tip=tip)
    # From the axes (z, x, y), which the prism was made in, to those of the frame.
    place = np.array([1e3, -2e3, 5e2])
    mesh = upright.replace(positions=upright.positions[:, [2, 0, 1]] @ frame * 4.0 + place)
    center = frame @ (center_about_axis(mesh, None, frame) - place)
    np.testing.assert_allclose(center[:2], 0.0, atol=1e-8)


@pytest.mark.parametrize(
    "mesh", [icosphere(2), plane(3, 2), prism(4)], ids=["sphere", "plane", "4"]
)
def test_the_middle_of_the_bounding_box_stays_to_the_last_bit(mesh: Mesh) -> None:
    found = center_about_axis(mesh, None, frame_about("y"))
    np.testing.assert_array_equal(found, center_of(mesh, None))


def test_a_corner_inside_the_circle_or_a_part_of_one_changes_nothing() -> None:
    bent = prism(5)
    positions = bent.positions.copy()
    positions[[0, 5]] *= (0.9, 1.0, 0.9)
    for mesh in (bent.replace(positions=positions), bent.replace(faces=bent.faces[:1])):
        found = center_about_axis(mesh, None, frame_about("y"))
        np.testing.assert_array_equal(found, center_of(mesh, None))

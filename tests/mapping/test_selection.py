from __future__ import annotations

import numpy as np
import pytest

from texbake import unwrap, unwrap_with_report
from texbake.errors import OptionError
from texbake.mapping.selection import faces_of_group, selected
from texbake.mesh.mesh import Mesh
from texbake.mesh.shapes import cube, plane


def grouped(mesh: Mesh) -> Mesh:
    groups = np.arange(mesh.n_faces) % 3
    return mesh.replace(face_groups=groups, group_names=("a", "b", "a", "none"))


def test_groups_of_one_name_are_one() -> None:
    assert faces_of_group(grouped(cube()), "a").tolist() == [True, False, True] * 4


@pytest.mark.parametrize("name", ["c", "none", ""])
def test_a_group_that_is_not_there_names_those_that_are(name: str) -> None:
    with pytest.raises(OptionError, match="it has a, b, a, none"):
        faces_of_group(grouped(cube()), name)
    with pytest.raises(OptionError, match="has no groups"):
        faces_of_group(cube(), name)


def test_faces_keep_what_is_theirs() -> None:
    mesh = grouped(plane(3, 3))
    part = selected(mesh, faces_of_group(mesh, "b"))
    assert np.array_equal(part.corner_uvs(), mesh.corner_uvs()[1::3])
    assert part.face_groups is not None and set(part.face_groups) == {1}


@pytest.mark.parametrize("method", ["planar", "atlas"])
def test_only_one_group_is_mapped(method: str) -> None:
    mesh = grouped(plane(3, 3))
    mapped = unwrap(mesh, method=method, only="b", offset=(5.0, 5.0))
    new = faces_of_group(mesh, "b")
    assert np.array_equal(mapped.corner_uvs()[~new], mesh.corner_uvs()[~new])
    assert (mapped.corner_uvs()[new] >= 5.0).all()
    assert np.array_equal(mapped.faces, mesh.faces)


def test_other_groups_without_coordinates_are_counted() -> None:
    mapped, report = unwrap_with_report(grouped(cube()), method="planar", only="b")
    assert report.tallies["faces of other groups without coordinates"] == 8
    assert (mapped.corner_uvs()[0] == 0.0).all()

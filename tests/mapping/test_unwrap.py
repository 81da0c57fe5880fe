import json
from pathlib import Path

import numpy as np
import pytest

from texbake.errors import OptionError
from texbake.mapping.areas import signed_areas
from texbake.mapping.options import UnwrapOptions
from texbake.mapping.overlap import overlapping_faces
from texbake.mapping.unwrap import unwrap, unwrap_with_report
from texbake.mesh.files import read_mesh
from texbake.mesh.mesh import Mesh
from texbake.mesh.shapes import cube, grid_sphere, icosphere, plane
from texbake.progress import ProgressSink

FAN = [[0, 0, 0], [0, 0, 1], [1, 0, 0], [-0.5, 0.9, 0], [-0.5, -0.9, 0]]

HARD = {
    "one face": ([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]),
    "three faces at an edge": (FAN, [[0, 1, 2], [0, 1, 3], [0, 1, 4]]),
    "the same face twice": (FAN, [[0, 1, 2], [0, 1, 2], [0, 1, 3]]),
    "a face and its back": (FAN, [[0, 1, 2], [2, 1, 0]]),
    "a face with one corner twice": (FAN, [[0, 1, 2], [0, 0, 1], [3, 3, 3]]),
    "a face on a line": ([*FAN, [0, 0, 0.5]], [[0, 1, 2], [0, 5, 1]]),
    "two parts, one tiny": (
        [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0.5, 0.5, 1], [0.50001, 0.5, 1], [0.5, 0.50001, 1]],
        [[0, 1, 2], [3, 4, 5]],
    ),
    "two faces that touch at a corner": (FAN, [[0, 1, 2], [0, 3, 4]]),
}


def assert_sound(before: Mesh, after: Mesh, padding: int, size: tuple[int, int]) -> None:
    """Everything that holds for any mesh that was unwrapped."""
    assert after.positions is before.positions or np.array_equal(after.positions, before.positions)
    assert np.array_equal(after.faces, before.faces)
    corners = after.corner_uvs()
    texels = corners * size
    assert (texels >= padding).all()
    assert (texels <= np.array(size) - padding).all()
    assert (signed_areas(corners) >= 0.0).all()
    assert not overlapping_faces(corners).any()


@pytest.mark.parametrize("mesh", [cube(), icosphere(3), grid_sphere(20, 40), plane(5, 5)])
@pytest.mark.parametrize("size", [256, (512, 128)])
def test_made_meshes(mesh: Mesh, size: int | tuple[int, int]) -> None:
    unwrapped, report = unwrap_with_report(mesh, size=size, padding=3)
    assert_sound(mesh, unwrapped, 3, (size, size) if isinstance(size, int) else size)
    found = report.distortion
    assert found.n_measured == mesh.n_faces
    assert found.n_charts == report.n_charts
    assert found.fill == pytest.approx(report.fill)
    assert found.stretch.l2 < 1.03
    assert found.stretch.symmetric_dirichlet < 4.15


@pytest.mark.parametrize("name", HARD)
def test_hard_meshes(name: str) -> None:
    positions, faces = HARD[name]
    mesh = Mesh(positions=positions, faces=faces, name=name)
    unwrapped, report = unwrap_with_report(mesh, size=64, padding=1)
    assert_sound(mesh, unwrapped, 1, (64, 64))
    solid = report.distortion.n_degenerate + report.distortion.n_measured
    assert solid == mesh.n_faces
    assert report.n_ignored == report.distortion.n_degenerate


def test_two_shells_in_one_place_get_coordinates_of_their_own() -> None:
    shell = icosphere(2)
    twice = Mesh(
        positions=np.concatenate([shell.positions, shell.positions]),
        faces=np.concatenate([shell.faces, shell.faces + shell.n_vertices]),
    )
    unwrapped, report = unwrap_with_report(twice, size=512, padding=2)
    assert_sound(twice, unwrapped, 2, (512, 512))
    assert report.distortion.n_measured == 2 * shell.n_faces


def test_everything_else_of_the_mesh_stays() -> None:
    mesh = plane(2, 2)
    mesh = mesh.replace(
        normals=[[0, 0, 1]],
        normal_faces=np.zeros_like(mesh.faces),
        tangents=np.tile([1.0, 0.0, 0.0, 1.0], (8, 3, 1)),
        colors=np.full((9, 3), 0.5),
        face_groups=np.zeros(8, dtype=np.int32),
        group_names=("top",),
        name="table.obj",
    )
    unwrapped = unwrap(mesh, size=64)
    for field in ("positions", "faces", "normals", "normal_faces", "colors", "face_groups"):
        assert getattr(unwrapped, field) is getattr(mesh, field) or np.array_equal(
            getattr(unwrapped, field), getattr(mesh, field)
        )
    assert (unwrapped.group_names, unwrapped.name) == (("top",), "table.obj")
    assert unwrapped.tangents is None  # they were made for other coordinates


def test_options_and_changes_say_the_same() -> None:
    mesh = icosphere(1)
    first = unwrap(mesh, UnwrapOptions(size=128, padding=2))
    second = unwrap(mesh, UnwrapOptions(size=4096, padding=2), size=128)
    assert np.array_equal(first.corner_uvs(), second.corner_uvs())
    with pytest.raises(OptionError, match="size"):
        unwrap(mesh, size=0)


def test_the_report_is_json_and_the_stages_are_told() -> None:
    class Listener(ProgressSink):
        def __init__(self) -> None:
            self.stages: list[str] = []

        def started(self, stage: str, total: int | None, unit: str) -> None:
            self.stages.append(stage)

        def advanced(self, stage: str, done: int) -> None:
            pass

        def finished(self, stage: str, seconds: float) -> None:
            pass

    listener = Listener()
    _, report = unwrap_with_report(icosphere(2), size=(256, 128), progress=listener)
    assert listener.stages == ["cut charts", "pack charts", "measure"]
    written = json.loads(json.dumps(report.to_json(), allow_nan=False))
    assert written["charts"] == report.n_charts
    assert written["options"]["size"] == [256, 128]
    assert written["distortion"]["l2"] == report.distortion.stretch.l2
    assert written["seconds"] == pytest.approx(sum(s["seconds"] for s in written["stages"]))


@pytest.mark.realdata
@pytest.mark.parametrize(
    ("name", "least_fill"),
    # xatlas' own packing with 2 texels between charts fills 0.55 and 0.48, and not the size asked.
    [("pairs/spot/low.obj", 0.67), ("pairs/koala/low.obj", 0.69)],
)
def test_real_meshes(name: str, least_fill: float, data_dir: Path) -> None:
    mesh = read_mesh(data_dir / name)
    unwrapped, report = unwrap_with_report(mesh, size=1024, padding=1)
    assert_sound(mesh, unwrapped, 1, (1024, 1024))
    assert report.fill > least_fill
    assert report.distortion.stretch.l2 < 1.02
    assert report.distortion.n_measured == mesh.n_faces


@pytest.mark.realdata
def test_a_broken_mesh(data_dir: Path) -> None:
    mesh = read_mesh(data_dir / "broken" / "openscad-nonmanifold-crash.obj")
    unwrapped, report = unwrap_with_report(mesh, size=1024, padding=1)
    assert_sound(mesh, unwrapped, 1, (1024, 1024))
    assert report.n_split_charts > 0  # coplanar faces that lie on one another

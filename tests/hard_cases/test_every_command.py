"""Size, place, direction and order of a mesh change no command's result by more than its bound.

Each command meets each change on another mesh, and those on which it has failed.
"""

import itertools
from collections.abc import Iterator

import numpy as np
import pytest
from catalog.case import Case
from catalog.cells import in_cells
from invariance.changes import (
    CHANGES,
    CORNERS,
    FACES,
    KINDS,
    PLACE,
    QUARTER,
    SCALE,
    SHIFT,
    Change,
)
from invariance.product import COMMANDS, MESHES, UNDECIDED, faults_of
from invariance.quantities import LENGTH, POINT, Quantity, Side, compared, sides

import texbake
from texbake import Mesh
from texbake.jobs.options import LightenOptions
from texbake.mesh.shapes import uv_sphere
from texbake.verbs.lighten import lighten_file

# Each xatlas is a process of its own, and these take a second for some meshes.
SLOW = {
    "unwrap by xatlas", "unwrap best", "unwrap keep", "checker", "cage", "simplify best",
    "simplify to an error", "compare", "bake", "bake in object space", "bake of closest points",
    "bake of adaptive samples", "bake of parts", "remap",
}  # fmt: skip

# They take no time, so that they meet every mesh.
QUICK = {"info", "normals"}

# Where a command has failed: its mesh, and the kind of change.
ONCE_FAILED = (
    ("unwrap projector", "bow-tie vertex", PLACE),
    ("unwrap projector", "bow-tie vertex", CORNERS),
    ("unwrap projector", "torus", PLACE),
    ("unwrap cylindrical", "T-junctions", CORNERS),
    ("unwrap spherical", "T-junctions", CORNERS),
    ("unwrap fast", "points on one line", QUARTER),
    ("bake-texture of a photograph", "negative zeros", SHIFT),
    ("bake-texture of a photograph", "offset 1e7 sizes", PLACE),
    ("bake-texture of a photograph", "coordinates of 1e300", SCALE),
    ("bake-texture marble", "subnormal coordinates", FACES),
    ("tangents", "needles", QUARTER),
    ("tangents", "strip of 1 by 1e6", QUARTER),
    ("layout", "coordinates of 1e300", SCALE),
    ("cage", "coordinates of 1e300", SCALE),
    ("repair", "coordinates of 1e300", SCALE),
    ("normals", "subnormal coordinates", FACES),
    ("bake of adaptive samples", "all in one point", CORNERS),
)


def chosen(command: str) -> Iterator[tuple[Case[Mesh], Change]]:
    """Another mesh for each change, and others for each command; for quick ones, every mesh."""
    start = 5 * list(COMMANDS).index(command)
    for index, change in enumerate(CHANGES):
        if command in QUICK:
            yield from ((mesh, change) for mesh in MESHES[index % 4 :: 4])
        if command not in SLOW or (index + start) % 4 == 0:
            yield MESHES[(start + 7 * index) % len(MESHES)], change


def once_failed(command: str) -> Iterator[tuple[Case[Mesh], Change]]:
    """The meshes and changes of a command that have failed."""
    cases = {case.name: case for case in MESHES}
    for name, mesh, kind in ONCE_FAILED:
        if name == command:
            yield from ((cases[mesh], change) for change in CHANGES if change.kind == kind)


@pytest.mark.parametrize("command", COMMANDS)
def test_a_change_of_the_mesh_changes_its_result_within_bounds(command):
    pairs = itertools.chain(chosen(command), once_failed(command))
    assert list(faults_of(command, pairs, in_cells)) == []


def test_a_result_that_is_not_changed_along_is_found():
    """A command that works in model units, or by the order of vertices, does not pass."""
    change = {change.kind: change for change in CHANGES}
    case = next(case for case in MESHES if case.name == "torus")

    def differ(kind: str, quantity: Quantity, of: object) -> bool:
        changed = change[kind].applied(case.make())
        one, two = (Quantity(values=of(side), unit=quantity.unit, bounds=quantity.bounds)
                    for side in sides(changed))  # fmt: skip
        return not compared({"it": one}, {"it": two}, changed)[0].holds

    def rounded(side: Side) -> np.ndarray:
        return np.round(side.mesh.positions, 3)

    like = Quantity(values=np.zeros(1), unit=POINT, bounds={SCALE: 0.0, PLACE: 0.0, FACES: 0.0})
    assert differ(SCALE, like, rounded)
    assert not differ(FACES, like, rounded)
    assert not differ(SCALE, like, lambda side: side.mesh.positions)
    length = Quantity(values=np.zeros(1), unit=LENGTH, bounds={PLACE: 0.0})
    assert differ(PLACE, length, lambda side: np.linalg.norm(side.mesh.positions, axis=1))


def test_what_is_undecided_is_named_by_meshes_and_kinds_that_there_are():
    names = {case.name for case in MESHES}
    for item in UNDECIDED:
        assert item.meshes <= names and set(item.kinds) <= set(KINDS) and item.reason
    assert {name for name, _, _ in ONCE_FAILED} <= COMMANDS.keys()
    assert {mesh for _, mesh, _ in ONCE_FAILED} <= names


WHOLE_JOBS = [change for change in CHANGES if change.kind == SCALE or change.kind == PLACE][1::3]


@pytest.mark.parametrize("change", WHOLE_JOBS, ids=lambda change: change.name)
def test_a_whole_run_changes_no_bit_of_its_maps(change, case_named, tmp_path):
    changed = change.applied(case_named("torus").make())
    options = texbake.RunOptions(n_faces=60, size=32, padding=1, quality="fast", threads=1)
    results = []
    for name, side in zip(("one", "two"), sides(changed), strict=True):
        (tmp_path / name).mkdir()
        results.append(texbake.run(side.mesh, tmp_path / name, options))
    one, two = results
    np.testing.assert_array_equal(two.low.faces, one.low.faces)
    np.testing.assert_array_equal(two.low.corner_uvs(), one.low.corner_uvs())
    np.testing.assert_array_equal(two.baked.maps["normal"].values, one.baked.maps["normal"].values)


def test_a_lightened_model_has_the_same_images_at_another_size(tmp_path):
    scale = 2.0**20
    mesh = uv_sphere(8, 16)
    written = []
    for name, size in ("one", 1.0), ("two", scale):
        model, lighter = tmp_path / f"{name}.glb", tmp_path / f"{name}_lighter.glb"
        texbake.write_mesh(mesh.replace(positions=mesh.positions * size), model)
        lighten_file(
            model,
            lighter,
            LightenOptions(n_faces=100, size=32, padding=1, quality="fast", samples=1, threads=1),
        )
        mesh_read = texbake.read_mesh(lighter)
        materials = texbake.read_materials(lighter, mesh_read)
        images = [
            source.image.data
            for material in materials.materials
            for source in material.channels.values()
            if source.image is not None
        ]
        written.append((mesh_read, images))
    (one, images), (two, others) = written
    np.testing.assert_array_equal(two.positions, one.positions * scale)
    np.testing.assert_array_equal(two.corner_uvs(), one.corner_uvs())
    assert images and others == images

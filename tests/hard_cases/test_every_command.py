"""Size, place, direction and order of a mesh change no command's result by more than its bound.

Each command meets each change on another mesh, and those on which it has failed.
"""

import itertools
from typing import NamedTuple

import numpy as np
import pytest
from catalog.geometry import GEOMETRY
from catalog.texture_space import TEXTURE_SPACE, in_cells
from invariance import (
    CHANGES,
    CORNERS,
    FACES,
    KINDS,
    LENGTH,
    PLACE,
    POINT,
    SCALE,
    TURN,
    Quantity,
    changed,
    faults,
    outcome,
    sides,
)
from results_of_commands import PLAIN, TEXTURED

import texbake
from texbake.jobs.lighten_options import LightenOptions
from texbake.mesh.shapes import uv_sphere
from texbake.verbs.whole_jobs import lighten_file

MESHES = GEOMETRY + TEXTURE_SPACE
COMMANDS = PLAIN | TEXTURED


class Undecided(NamedTuple):
    """Where a result depends on the change, by its nature; commands by how their names begin."""

    reason: str
    commands: tuple[str, ...]
    kinds: tuple[str, ...]
    meshes: set[str]


UNDECIDED = (
    Undecided("of faces that lie on one another, in space or in the texture, the first counts",
              ("",), (FACES,), {
        "duplicate faces", "duplicate faces turned", "coincident shells",
        "sheets that cross along edges", "coordinates three deep",
        "mirrored halves sharing vertices", "opposing neighbors", "face over the ±π seam",
        "face that holds a pole"}),
    Undecided("the normals around a vertex cancel, and that of its first face is taken",
              ("",), (FACES,), {"edge of five faces", "bow-tie vertex", "Möbius strip"}),
    Undecided("no rule gives a tangent, which is then an axis of the space",
              ("tangents",), (TURN,), {
        "zero-area faces", "duplicate faces turned", "bow-tie vertex", "all in one point",
        "one index thrice", "zero-area coordinates", "coordinates of area down to 1e-24",
        "coordinates of 1e9", "coordinates on a line", "u constant", "all coordinates equal"}),
    Undecided("no rule gives a tangent at its vertex, and so none a normal in tangent space",
              ("bake",), (TURN,), {"bow-tie vertex"}),
    Undecided("from its smallest cube, several faces are equally close, and the first counts",
              ("bake of closest points",), (FACES,), {"sizes 1 to 1e-9 in one"}),
    Undecided("what touches a face closer than 2^-16 of the size may hide it",
              ("bake-texture of a photograph",), (CORNERS, TURN),
              {"duplicate faces turned", "sizes 1 to 1e-9 in one"}),
    Undecided("the camera lies in the plane of a face, and sees it or not by rounding",
              ("bake-texture of a photograph",), (TURN,),
              {"duplicate faces", "wall thinner than the cage", "negative zeros"}),
    Undecided("the middle of three sheets is seen from one side as little as from the other",
              ("orientation",), (TURN,), {"coordinates three deep"}),
    Undecided("float64 holds few bits of it, and no power of two that makes it of unit size",
              ("cage", "bake-texture", "normals", "transform"), (SCALE,),
              {"subnormal coordinates"}),
    Undecided("it has no size that lengths could be relative to",
              ("bake", "remap", "cage"), (SCALE,), {"all in one point"}),
    Undecided("the cage of a cube 1e-9 large reaches for points a billion times as far away",
              ("cage",), (FACES,), {"sizes 1 to 1e-9 in one"}),
)  # fmt: skip

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
    ("unwrap fast", "points on one line", TURN),
    ("bake-texture of a photograph", "offset 1e7 sizes", PLACE),
    ("bake-texture of a photograph", "coordinates of 1e300", SCALE),
    ("bake-texture marble", "subnormal coordinates", FACES),
    ("tangents", "needles", TURN),
    ("tangents", "strip of 1 by 1e6", TURN),
    ("layout", "coordinates of 1e300", SCALE),
    ("cage", "coordinates of 1e300", SCALE),
    ("repair", "coordinates of 1e300", SCALE),
    ("normals", "subnormal coordinates", FACES),
    ("bake of adaptive samples", "all in one point", CORNERS),
)


def chosen(command):
    """Another mesh for each change, and others for each command; for quick ones, every mesh."""
    start = 5 * list(COMMANDS).index(command)
    for index, change in enumerate(CHANGES):
        if command in QUICK:
            yield from ((mesh, change) for mesh in MESHES[index % 4 :: 4])
        if command not in SLOW or (index + start) % 4 == 0:
            yield MESHES[(start + 7 * index) % len(MESHES)], change


def once_failed(command):
    """The meshes and changes of a command that have failed."""
    cases = {case.name: case for case in MESHES}
    for name, mesh, kind in ONCE_FAILED:
        if name == command:
            yield from ((cases[mesh], change) for change in CHANGES if change.kind == kind)


def is_decided(command, change, mesh):
    return not any(
        change.kind in item.kinds and mesh in item.meshes and command.startswith(item.commands)
        for item in UNDECIDED
    )


@pytest.mark.parametrize("command", COMMANDS)
def test_a_change_of_the_mesh_changes_its_result_within_bounds(command):
    known = {}
    wrong = []
    for case, change in itertools.chain(chosen(command), once_failed(command)):
        if not is_decided(command, change, case.name):
            continue
        pair = changed(change, in_cells(case) if command in TEXTURED else case.make())
        one, two = sides(pair)
        key = case.name, change.kind == PLACE
        if key not in known:
            known[key] = outcome(COMMANDS[command], one)
        after = outcome(COMMANDS[command], two)
        wrong += [
            f"{case.name}, {change.kind} {change.name}: {fault}"
            for fault in faults(known[key], after, pair)
        ]
    assert wrong == []


def test_a_result_that_is_not_changed_along_is_found(case_named):
    """A command that works in model units, or by the order of vertices, does not pass."""
    change = {change.kind: change for change in CHANGES}

    def differ(kind, of, **bounds):
        pair = changed(change[kind], case_named("torus").make())
        return faults(*({"it": Quantity(values=of(s.mesh), **bounds)} for s in sides(pair)), pair)

    def rounded(mesh):
        return np.round(mesh.positions, 3)

    assert differ(SCALE, rounded, unit=POINT)
    assert not differ(FACES, rounded, unit=POINT, order=0.0)
    assert not differ(SCALE, lambda mesh: mesh.positions, unit=POINT)
    assert differ(PLACE, lambda mesh: np.linalg.norm(mesh.positions, axis=1), unit=LENGTH)


def test_what_is_undecided_is_named_by_meshes_and_kinds_that_there_are():
    names = {case.name for case in MESHES}
    for item in UNDECIDED:
        assert item.meshes <= names and set(item.kinds) <= set(KINDS) and item.reason
    assert {name for name, _, _ in ONCE_FAILED} <= COMMANDS.keys()
    assert {mesh for _, mesh, _ in ONCE_FAILED} <= names


@pytest.mark.parametrize("name", ["2^50", "by 2^10 sizes"])
def test_a_whole_run_changes_no_bit_of_its_maps(name, case_named, small_pictures, tmp_path):
    (change,) = (change for change in CHANGES if change.name == name)
    options = texbake.RunOptions(n_faces=60, size=32, padding=1, quality="fast", threads=1)
    results = []
    for side in sides(changed(change, case_named("torus").make())):
        folder = tmp_path / str(len(results))
        folder.mkdir()
        results.append(texbake.run(side.mesh, folder, options))
    one, two = results
    np.testing.assert_array_equal(two.low.faces, one.low.faces)
    np.testing.assert_array_equal(two.low.corner_uvs(), one.low.corner_uvs())
    np.testing.assert_array_equal(two.baked.maps["normal"].values, one.baked.maps["normal"].values)


def test_a_lightened_model_has_the_same_images_at_another_size(small_pictures, tmp_path):
    scale = 2.0**20
    mesh = uv_sphere(8, 16)
    written = []
    for name, size in ("one", 1.0), ("two", scale):
        model, lighter = tmp_path / f"{name}.glb", tmp_path / f"{name}_lighter.glb"
        texbake.write_mesh(mesh.replace(positions=mesh.positions * size), model)
        lighten_file(
            model,
            lighter,
            LightenOptions(
                n_faces=100, size=32, padding=1, quality="fast", samples=1, views=0, threads=1
            ),
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

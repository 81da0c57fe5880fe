"""Place and size of a mesh change no choice: the same triangles, charts, seams and distances."""

from functools import cache

import numpy as np
import pytest
from models import bracket, creature, joined, moved, sponge

import texbake
from texbake.mesh.frame import UnitGrid
from texbake.mesh.hard_edges import with_normals
from texbake.mesh.shapes import icosphere, orange, uv_sphere

# None is a power of two, so each rounds every coordinate.
FACTORS = (100.0, 0.01, 3.0, 1e5, 1e-3, 7.3)

# Meshes on which many choices cost the same, and two without such.
MESHES = {
    "icosphere": lambda: icosphere(2), "sphere with coordinates": lambda: uv_sphere(8, 16),
    "orange": lambda: orange(1000),
    "two objects": lambda: joined(
        icosphere(2), moved(uv_sphere(8, 16), scale=0.5, by=(1.7, 0.3, 0.1)),
    ),
    "plate with holes": lambda: bracket(2, 1, 8), "sponge": lambda: sponge(1),
    "figure": lambda: creature(12), "noisy figure": lambda: noisy(creature(12)),
}  # fmt: skip


def noisy(mesh):
    noise = np.random.default_rng(0).normal(size=mesh.positions.shape)
    return mesh.replace(positions=mesh.positions + 0.01 * noise)


def lists(mesh):
    names = ("faces", "uvs", "uv_faces", "normal_faces", "face_groups")
    return {name: getattr(mesh, name) for name in names if getattr(mesh, name) is not None}


def made(mesh):
    return lists(mesh), mesh.positions


def simplified(quality, error=None):
    def simplify(mesh):
        n_faces = None if error else mesh.n_faces // 4
        return made(texbake.simplify(mesh, n_faces, error=error, quality=quality))

    return simplify


def unwrapped(**options):
    return lambda mesh: made(texbake.unwrap(mesh, size=128, **options))


def remeshed(mesh):
    return made(texbake.remesh(mesh, texbake.RemeshOptions(resolution=16)))


def repaired(mesh):
    return made(texbake.repair(mesh)[0])


def caged(mesh):
    cage = texbake.fit_cage(mesh, texbake.simplify(mesh, mesh.n_faces // 4))
    return lists(cage.mesh), cage.distances


def checked(mesh):
    report = texbake.check(mesh, options=texbake.CheckOptions(size=64))
    kinds = [(item.kind.name, item.count) for item in report.findings]
    return {"findings": [item for item in kinds if item[0] != "extreme-size"]}, np.zeros(0)


VERBS = {
    "simplify": simplified("fast"), "simplify best": simplified("best"),
    "simplify to an error": simplified("fast", "8%"), "unwrap": unwrapped(),
    "unwrap fast": unwrapped(quality="fast"), "remesh": remeshed, "repair": repaired, "cage": caged,
    "check": checked,
}  # fmt: skip


def scaled(mesh, factor):
    return mesh.replace(positions=mesh.positions * factor)


@cache
def mesh_of(name):
    return MESHES[name]()


def factor_of(name, n_verb):
    """One of the factors; the meshes of each verb have all together, and the verbs of each mesh."""
    return FACTORS[(list(MESHES).index(name) + n_verb) % len(FACTORS)]


CASES = [
    (name, verb)
    for name in MESHES
    for verb in VERBS
    if verb != "simplify to an error" or name in ("two objects", "sponge")  # it takes seconds
]


@pytest.mark.parametrize(("name", "verb"), CASES)
def test_size_changes_no_choice(name, verb):
    mesh = mesh_of(name)
    wanted, lengths = VERBS[verb](mesh)
    side = np.ptp(mesh.positions, axis=0).max()
    factor = factor_of(name, list(VERBS).index(verb))
    found, scaled_lengths = VERBS[verb](scaled(mesh, factor))
    np.testing.assert_equal(found, wanted)
    assert np.abs(scaled_lengths / factor - lengths).max(initial=0.0) <= 1e-14 * side


@pytest.mark.parametrize("name", ["orange", "noisy figure"])
def test_maps_of_any_size_agree(name):
    """Simplified, unwrapped and baked, as by `run`."""
    found = {}
    for factor in (1.0, *FACTORS[:2]):
        high = scaled(mesh_of(name), factor)
        low = texbake.unwrap(texbake.simplify(high, 300, quality="best"), size=64)
        options = texbake.BakeOptions(size=64, maps=("normal", "displacement"))
        maps = texbake.bake(high, low, options).maps
        found[factor] = lists(low), maps["normal"].values, maps["displacement"].values / factor
    for low, normals, heights in found.values():
        np.testing.assert_equal(low, found[1.0][0])
        assert np.abs(normals - found[1.0][1]).max() < 2.0 / 255.0  # they are from -1 to 1
        assert np.abs(heights - found[1.0][2]).max() < 1e-6


@pytest.mark.parametrize("by", [(3.0, 0.1, -7.3), (0.7, 1e-3, 0.0)])
def test_place_changes_no_choice(by):
    mesh = icosphere(3)
    wanted = texbake.simplify(mesh, 300)
    assert np.array_equal(texbake.simplify(moved(mesh, by=by), 300).faces, wanted.faces)


@pytest.mark.parametrize("factor", FACTORS)
def test_points_on_the_grid_are_equal(factor):
    for mesh in (icosphere(4), orange(20_000), bracket(), moved(icosphere(3), by=(1e-3, 7.3, 2.0))):
        after = scaled(mesh, factor)
        points = UnitGrid.around(mesh).to_grid(mesh.positions)
        assert np.array_equal(UnitGrid.around(after).to_grid(after.positions), points)
        assert np.ptp(points, axis=0).max() == 1.0


def test_sides_of_a_prism_are_smooth_up_to_their_angle():
    mesh = texbake.make("cylinder", resolution=(6, 1))
    for factor in FACTORS:
        low = with_normals(scaled(mesh, factor), "angle", angle=60.0)
        assert len(low.normals) == len(np.unique(low.positions, axis=0))

"""Islands that lie exactly on one another, and those that only overlap."""

import numpy as np
import pytest

from texbake import Mesh, OptionError
from texbake.mapping.overlap import StackedIslands
from texbake.mesh.shapes import plane

# An island that no mirroring or turn takes to itself.
GRID = plane(4, 3)
ISLAND = GRID.replace(uvs=0.1 + 0.5 * GRID.uvs * [1.0, 0.8] + 0.1 * GRID.uvs[:, :1] * GRID.uvs)


def other_diagonals(mesh):
    a, b, c, d = mesh.faces[::2, 0], mesh.faces[::2, 1], mesh.faces[::2, 2], mesh.faces[1::2, 2]
    faces = np.concatenate([np.stack([a, b, d], axis=1), np.stack([b, c, d], axis=1)])
    return mesh.replace(faces=faces, uv_faces=faces)


def beside(*islands):
    """One mesh of several, a unit apart, each a group."""
    starts = np.cumsum([0, *(mesh.n_vertices for mesh in islands)])
    faces = np.concatenate([m.faces + s for m, s in zip(islands, starts, strict=False)])
    positions = [mesh.positions + np.array([2.0 * i, 0, 0]) for i, mesh in enumerate(islands)]
    return Mesh(
        positions=np.concatenate(positions), faces=faces,
        uvs=np.concatenate([mesh.uvs for mesh in islands]), uv_faces=faces,
        face_groups=np.repeat(np.arange(len(islands)), [m.n_faces for m in islands]),
        group_names=tuple(f"part{i}" for i in range(len(islands))),
    )  # fmt: skip


def moved(s, t):
    return ISLAND.replace(uvs=ISLAND.uvs + np.array([s, t]))


RANDOM = np.random.default_rng(0)
ORDER = RANDOM.permutation(ISLAND.n_faces)
ALIKE = {
    "the same": ISLAND,
    "moved by tiles": moved(3, -2),
    "rounded": ISLAND.replace(uvs=np.round(ISLAND.uvs, 6)),
    "mirrored": ISLAND.replace(faces=ISLAND.faces[:, ::-1], uv_faces=ISLAND.faces[:, ::-1]),
    "turned": ISLAND.replace(positions=ISLAND.positions[:, [1, 2, 0]]),
    "in another pose": ISLAND.replace(
        positions=ISLAND.positions + 0.1 * np.sin(5 * ISLAND.positions[:, :1])
    ),
    "other order": ISLAND.replace(faces=ISLAND.faces[ORDER], uv_faces=ISLAND.faces[ORDER]),
    "other diagonals": other_diagonals(ISLAND),
}  # fmt: skip
OTHERS = {
    "moved by less than a tile": moved(0.1, 0.0),
    "moved by a texel": moved(1 / 16384, 0.0),
    "mirrored in the texture": ISLAND.replace(uvs=[0.9, 0.0] - ISLAND.uvs * [1, -1]),
    "scaled": ISLAND.replace(uvs=ISLAND.uvs * 1.1),
    "of another shape in space": ISLAND.replace(positions=ISLAND.positions * [2, 1, 1]),
    "a part": ISLAND.replace(faces=ISLAND.faces[:-2], uv_faces=ISLAND.faces[:-2]),
    "one corner elsewhere": ISLAND.replace(
        uvs=ISLAND.uvs + 0.01 * (np.arange(ISLAND.n_vertices) == 6)[:, None]
    ),
}


@pytest.mark.parametrize("name", ALIKE)
def test_islands_that_coincide_share_texels(name):
    first, later = np.split(StackedIslands.of(beside(ISLAND, ALIKE[name])).shares, 2)
    assert not first.any()
    assert later.all()


@pytest.mark.parametrize("name", OTHERS)
def test_islands_that_only_overlap_do_not(name):
    mesh = beside(ISLAND, OTHERS[name])
    found = StackedIslands.of(mesh)
    assert not found.stacked.any() and found.baked(mesh) is mesh


def test_a_chart_folded_over_is_two_islands():
    sheet = plane(4, 2)
    uvs = np.abs(sheet.uvs - [0.5, 0.0])
    shares = StackedIslands.of(sheet.replace(uvs=uvs)).shares
    right = sheet.positions[sheet.faces].mean(axis=1)[:, 0] > sheet.positions[:, 0].mean()
    assert np.array_equal(shares, right) or np.array_equal(shares, ~right)


@pytest.mark.parametrize(
    ("named", "baked"),
    [((), 1), (("part2",), 2), (("0",), 0), (("50",), 2), (("part0", "part2"), 0)],
)
def test_which_island_is_baked(named, baked):
    """The first in the tile, or the first of those named; it is moved into the tile."""
    outside = moved(1, 0)
    mesh = beside(outside, ISLAND, ISLAND)
    found = StackedIslands.of(mesh, named)
    assert np.array_equal(~found.shares, mesh.face_groups == baked)
    uvs = found.baked(mesh).corner_uvs()
    assert np.allclose(uvs[~found.shares], ISLAND.corner_uvs(), atol=1e-15)
    assert np.ptp(uvs[found.shares].reshape(-1, 2), axis=0).max() == 0.0


@pytest.mark.parametrize("name", ["part7", "72", "-1"])
def test_an_unknown_island_is_an_error(name):
    with pytest.raises(OptionError, match="name a face from 0 to 71, or one of its groups part0"):
        StackedIslands.of(beside(ISLAND, ISLAND, ISLAND), (name,))

"""Broken meshes, made from whole ones by mutation: the same seed gives the same mesh."""

import numpy as np

from texbake.mesh.mesh import Mesh
from texbake.mesh.shapes import cube, grid_sphere, icosphere, plane


def _shapes(random):
    n = int(random.integers(2, 16))
    return [
        lambda: plane(n, int(random.integers(1, 16))),
        lambda: cube(),
        lambda: icosphere(int(random.integers(0, 4))),
        lambda: grid_sphere(n + 1, 2 * n + 1),
        lambda: _torus(4 * n, 3 + n // 2),
    ]


def _torus(n_around, n_across):
    u, v = np.meshgrid(np.arange(n_around), np.arange(n_across), indexing="ij")
    around, across = 2 * np.pi * u.ravel() / n_around, 2 * np.pi * v.ravel() / n_across
    radius = 1.0 + 0.4 * np.cos(across)
    ids = np.arange(n_around * n_across).reshape(n_around, n_across)
    a, b = ids, np.roll(ids, -1, axis=0)
    c, d = np.roll(b, -1, axis=1), np.roll(a, -1, axis=1)
    return Mesh(
        positions=np.stack(
            [radius * np.cos(around), radius * np.sin(around), 0.4 * np.sin(across)], axis=1
        ),
        faces=np.concatenate([np.stack(f, axis=-1).reshape(-1, 3) for f in ((a, b, c), (a, c, d))]),
    )


def _some(random, n, most=0.2):
    """A few of n items: one, or up to a share."""
    count = max(1, int(n * random.uniform(0.0, most)))
    return random.choice(n, min(count, n), replace=False)


def doubled(positions, faces, random):
    """Faces that exist twice, some of them the other way round."""
    copies = faces[_some(random, len(faces), 1.0)]
    turned = random.random(len(copies)) < random.choice([0.0, 0.5, 1.0])
    copies = np.where(turned[:, None], copies[:, ::-1], copies)
    return positions, np.concatenate([faces, copies])


def doubled_apart(positions, faces, random):
    """The whole once more, a little beside itself, with vertices of its own."""
    beside = positions + random.normal(size=positions.shape) * 10.0 ** random.uniform(-9, -2)
    return np.concatenate([positions, beside]), np.concatenate([faces, faces + len(positions)])


def torn(positions, faces, random):
    """Faces missing, and others no longer joined to their neighbors."""
    faces = np.delete(faces, _some(random, len(faces), 0.5), axis=0)
    if len(faces) == 0:
        return positions, np.array([[0, 1, 2]])
    loose = _some(random, len(faces))
    corners = faces[loose].ravel()
    faces = faces.copy()
    faces[loose] = len(positions) + np.arange(len(corners)).reshape(-1, 3)
    return np.concatenate([positions, positions[corners]]), faces


def fins(positions, faces, random):
    """Faces between vertices anywhere: edges of three faces and more."""
    n = int(random.integers(1, 2 + len(faces) // 4))
    return positions, np.concatenate([faces, random.integers(0, len(positions), (n, 3))])


def pinched(positions, faces, random):
    into = np.arange(len(positions))
    into[_some(random, len(into))] = int(random.integers(len(into)))
    return positions, into[faces]


def turned(positions, faces, random):
    faces = faces.copy()
    some = _some(random, len(faces), 1.0)
    faces[some] = faces[some][:, ::-1]
    return positions, faces


def needles(positions, faces, random):
    """All of it drawn out along one axis, or vertices moved next to a neighbor."""
    positions = positions.copy()
    if random.random() < 0.5:
        positions[:, int(random.integers(3))] *= 10.0 ** random.uniform(1, 6)
        return positions, faces
    some = faces[_some(random, len(faces), 0.5)]
    share = 10.0 ** random.uniform(-12, -2)
    positions[some[:, 0]] = positions[some[:, 1]] + share * (
        positions[some[:, 0]] - positions[some[:, 1]]
    )
    return positions, faces


def spiked(positions, faces, random):
    """Vertices thrown far away, and noise on all."""
    positions = positions + random.normal(size=positions.shape) * 10.0 ** random.uniform(-6, 0)
    some = _some(random, len(positions), 0.05)
    positions[some] += random.normal(size=(len(some), 3)) * 10.0 ** random.uniform(0, 5)
    return positions, faces


def fanned(positions, faces, random):
    """A fan of many thin faces around one vertex, wound around it more than once."""
    n = int(random.integers(3, 400))
    angles = np.linspace(0.0, 2.0 * np.pi * random.uniform(0.1, 4.0), n)
    rim = np.stack([np.cos(angles), np.sin(angles), angles * random.choice([0.0, 0.1])], axis=1)
    center = len(positions)
    ring = center + 1 + np.arange(n)
    fan = np.stack([np.full(n - 1, center), ring[:-1], ring[1:]], axis=1)
    return np.concatenate([positions, [[0.0, 0.0, 0.0]], rim]), np.concatenate([faces, fan])


def collapsed(positions, faces, random):
    """Faces without area: two corners are one, or all lie on a line."""
    faces = faces.copy()
    some = _some(random, len(faces), 0.5)
    faces[some, 0] = faces[some, 1]
    return positions, faces


MUTATIONS = (
    doubled, doubled_apart, torn, fins, pinched, turned, needles, spiked, fanned, collapsed,
)  # fmt: skip


def broken_mesh(seed):
    """A mesh of up to a few thousand faces after one to four mutations, and their names."""
    random = np.random.default_rng(seed)
    shapes = _shapes(random)
    mesh = shapes[int(random.integers(len(shapes)))]()
    positions, faces = np.array(mesh.positions), np.array(mesh.faces, dtype=np.int64)
    names = []
    for _ in range(int(random.integers(1, 5))):
        mutation = MUTATIONS[int(random.integers(len(MUTATIONS)))]
        positions, faces = mutation(positions, faces, random)
        names.append(mutation.__name__)
    return Mesh(positions=positions, faces=faces.astype(np.int32), name="+".join(names)), names

"""A small character: a bent tube of two bones with a morph target, and a wheel that turns."""

import numpy as np

from texbake.core import portable_math as pm
from texbake.mesh.deformation import Deformation, Morph
from texbake.mesh.mesh import Mesh
from texbake.mesh.rig import Rig, RigObject

ROOT, LOWER, UPPER, BODY, AXLE, WHEEL, EYE = range(7)
TIMES = np.linspace(0.0, 1.0, 5)
_SCALE = 0.5  # of the node of the wheel


def _grid(n: int, rings: int) -> np.ndarray:
    """Faces of a tube, n around."""
    i, k = np.meshgrid(np.arange(n), np.arange(rings - 1))
    a, b = k * n + i, k * n + (i + 1) % n
    quads = np.stack([a, b, b + n, a + n], axis=-1).reshape(-1, 4)
    return quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)


def _tube(n: int, rings: int, radius: float) -> np.ndarray:
    heights, angles = np.meshgrid(np.linspace(0, 2, rings), 2 * np.pi * np.arange(n) / n)
    points = np.stack([radius * pm.cos(angles), heights, -radius * pm.sin(angles)], axis=-1)
    return points.swapaxes(0, 1).reshape(-1, 3)


def character(n: int = 24, rings: int = 41) -> tuple[Mesh, Rig]:
    """Mesh and rig; the mesh has two objects, the tube and the wheel."""
    body, wheel = _tube(n, rings, 0.3), _tube(8, 2, 0.2)
    place = np.eye(4)
    place[:3, :3] *= _SCALE
    place[:3, 3] = 1.0, 0.5, 0.0
    upper = np.clip((body[:, 1] - 0.6) / 0.8, 0.0, 1.0)
    joints = np.concatenate([np.tile([LOWER, UPPER], (len(body), 1)), np.tile([AXLE, 0], (16, 1))])
    weights = np.concatenate([np.stack([1 - upper, upper], axis=1), np.tile([1.0, 0.0], (16, 1))])
    bulge = body * [1, 0, 1] * pm.exp(-(((body[:, 1:2] - 1.6) / 0.15) ** 2))
    bulge[np.abs(bulge) < 1e-3] = 0.0
    faces = np.concatenate([_grid(n, rings), len(body) + _grid(8, 2)])
    mesh = Mesh(
        positions=np.concatenate([body, wheel * _SCALE + place[:3, 3]]).astype(np.float32),
        faces=faces, face_groups=np.repeat([0, 1], [2 * n * (rings - 1), 16]),
        group_names=("body", "wheel"), group_objects=(BODY, WHEEL),
        deformation=Deformation(
            joints.astype(np.int32), weights,
            (Morph.of_rows(np.concatenate([bulge, 0 * wheel]).astype(np.float32).astype(float)),),
        ),
        name="character",
    )  # fmt: skip
    bind = np.tile(np.eye(4), (2, 1, 1))
    bind[1, 3, 1] = -1.0  # columns are written one after the other
    turn = np.stack([0 * TIMES, 0 * TIMES, pm.sin(TIMES * np.pi / 4), pm.cos(TIMES * np.pi / 4)])
    arrays = (bind.reshape(2, 16), TIMES[:, None], turn.T, pm.sin(np.pi * TIMES)[:, None])
    channels = [(UPPER, "rotation", 2), (AXLE, "rotation", 2), (BODY, "weights", 3)]
    content = {
        "nodes": [
            {"name": "root", "children": [LOWER, BODY, AXLE, EYE]},
            {"name": "lower", "children": [UPPER]},
            {"name": "upper", "translation": [0, 1, 0]},
            {"name": "body", "skin": 0},
            {"name": "axle", "translation": [1, 0.5, 0], "children": [WHEEL]},
            {"name": "wheel", "scale": [_SCALE] * 3},
            {"name": "eye", "camera": 0, "extensions": {"KHR_lights_punctual": {"light": 0}}},
        ],
        "scenes": [{"nodes": [ROOT]}],
        "skins": [{"joints": [LOWER, UPPER], "inverseBindMatrices": 0, "skeleton": LOWER}],
        "cameras": [{"type": "perspective", "perspective": {"yfov": 0.7, "znear": 0.1}}],
        "animations": [
            {
                "name": "wave",
                "samplers": [
                    {"input": 1, "output": output, "interpolation": "LINEAR"}
                    for _, _, output in channels
                ],
                "channels": [
                    {"sampler": i, "target": {"node": node, "path": path}}
                    for i, (node, path, _) in enumerate(channels)
                ],
            }
        ],
        "extensions": {"KHR_lights_punctual": {"lights": [{"type": "point", "name": "lamp"}]}},
    }
    rig = Rig(
        content=content, arrays={i: rows.astype(np.float32) for i, rows in enumerate(arrays)},
        objects={
            BODY: RigObject(
                node=BODY, matrix=np.eye(4),
                fields={"name": "tube", "extras": {"targetNames": ["bulge"]}}, n_morphs=1,
            ),
            WHEEL: RigObject(node=WHEEL, matrix=place),
        },
        has_morph_normals=True,
    )  # fmt: skip
    return mesh, rig


def posed(mesh: Mesh, rig: Rig, share: float) -> np.ndarray:
    """(V, 3) positions of a mesh at a time of the animation, from 0 to 1."""
    deformation = mesh.deformation
    bulge = pm.sin(np.pi * share)
    points = mesh.positions.copy()
    for morph in deformation.morphs:
        points += bulge * morph.rows(mesh.n_vertices)
    angle = share * np.pi / 2
    turn = np.array([[pm.cos(angle), -pm.sin(angle), 0], [pm.sin(angle), pm.cos(angle), 0],
                     [0, 0, 1.0]])  # fmt: skip
    pivots = {LOWER: None, UPPER: [0, 1, 0], AXLE: [1, 0.5, 0]}
    moved = np.zeros_like(points)
    for node, pivot in pivots.items():
        weight = np.where(deformation.joints == node, deformation.weights, 0.0).sum(axis=1)
        turned = points if pivot is None else (points - pivot) @ turn.T + pivot
        moved += weight[:, None] * turned
    return moved

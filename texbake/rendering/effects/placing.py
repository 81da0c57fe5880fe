"""Objects in the world: every mesh by its transform."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from texbake.rendering.effect import Call, Effect, RenderState, Result, Target
from texbake.rendering.fragments import DrawnObject
from texbake.rendering.request import RenderRequest
from texbake.rendering.scene.placing import placed


def _called_for(request: RenderRequest) -> Iterator[Call]:
    for index in range(len(request.scene.objects)):
        yield Call(index, request.name(index), "it is in the scene")


def _load(state: RenderState, target: Target) -> DrawnObject:
    assert target is not None
    item = state.scene.objects[target]
    mesh = placed(item)
    inverse = None if item.transform is None else np.linalg.inv(item.transform)
    return DrawnObject(
        mesh=mesh,
        material=item.material,
        positions=mesh.positions,
        faces=mesh.faces,
        object_from_world=None if inverse is None else np.asarray(inverse, np.float64),
    )


PLACED_OBJECTS = Result(_load)

PLACING = Effect(
    name="placing",
    does="takes meshes to world space",
    called_for=_called_for,
    left_out="there is no object",
    load=PLACED_OBJECTS,
    moves_surface=True,
)

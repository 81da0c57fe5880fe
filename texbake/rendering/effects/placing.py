"""Objects in the world: every mesh by its transform."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from texbake.rendering.picture import DrawnObject, Picture
from texbake.rendering.plan.effect import Call, Effect, Target
from texbake.rendering.plan.question import Question
from texbake.rendering.scene.placing import placed


def _called_for(question: Question) -> Iterator[Call]:
    for index in range(len(question.scene.objects)):
        yield Call(index, question.name(index), "it is in the scene")


def _load(picture: Picture, target: Target) -> DrawnObject:
    assert target is not None
    item = picture.scene.objects[target]
    mesh = placed(item)
    inverse = None if item.transform is None else np.linalg.inv(item.transform)
    return DrawnObject(
        mesh=mesh,
        material=item.material,
        positions=mesh.positions,
        faces=mesh.faces,
        object_from_world=None if inverse is None else np.asarray(inverse, np.float64),
    )


PLACING = Effect(
    name="placing",
    does="takes meshes to world space",
    called_for=_called_for,
    left_out="there is no object",
    load=_load,
    moves_surface=True,
)

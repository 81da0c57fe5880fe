"""A scene: what `texbake preview SCENE.toml` reads and `render_scene` draws."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from texbake.errors import OptionError
from texbake.mesh.mesh import FloatArray, Mesh, frozen
from texbake.rendering.options import RenderOptions
from texbake.rendering.scene.lights import Lighting, Vector
from texbake.rendering.scene.material import Material
from texbake.schema import Option

# Least over greatest stretch. Rounding leaves about 1e-16 of a direction that is flattened; above
# this there are still three digits of it.
_SINGULAR = 1e-13


@dataclass(frozen=True, kw_only=True)
class View:
    """Where the camera stands.

    Either `position` and `target`, or (both None) `angles` about the middle of all objects, as far
    away as it takes to have them in the picture, as `RenderOptions.view` has it. What is None is
    as `RenderOptions` has it.
    """

    position: Annotated[Vector | None, Option("Position of the camera in world space.")] = None
    target: Annotated[Vector | None, Option("Point that the camera looks at, in world space.")] = (
        None
    )
    up: Annotated[
        Vector | None, Option("Direction that is up in the picture, with a position.")
    ] = None
    angles: Annotated[
        tuple[float, float] | tuple[float, float, float | None] | None,
        Option("Azimuth and elevation in degrees, and the distance in world units."),
    ] = None
    fov: Annotated[float | None, Option("Vertical field of view in degrees.")] = None
    near: Annotated[
        float | None, Option("Distance of the near plane, with a position; small without it.")
    ] = None

    def __post_init__(self) -> None:
        if (self.position is None) != (self.target is None):
            raise OptionError("camera: position and target belong together; give both or neither")
        if self.position is not None and self.angles is not None:
            raise OptionError("position: the angles say the same already; give one of them")
        for name in "up", "near":
            if getattr(self, name) is not None and self.position is None:
                raise OptionError(f"{name}: it belongs to a camera with a position; give that too")
        if self.fov is not None and not 0.0 < self.fov < 180.0:
            raise OptionError(f"fov: {self.fov:g} degrees show nothing; above 0 and below 180 do")
        if self.near is not None and not 0.0 < self.near < math.inf:
            raise OptionError(f"near: {self.near:g} is not above 0")


@dataclass(frozen=True, kw_only=True, eq=False)
class SceneObject:
    """A mesh somewhere, with a material."""

    mesh: Annotated[Mesh, Option("Mesh in its own space.")]
    material: Annotated[Material, Option("Material of the object.")] = field(
        default_factory=Material
    )
    transform: Annotated[
        FloatArray | None, Option("Matrix from the object's space to the world.")
    ] = None
    name: Annotated[str, Option("Name of the object in messages and in the plan.")] = "object"
    casts_shadows: Annotated[bool, Option("Whether the object casts shadows.")] = True
    receives_shadows: Annotated[bool, Option("Whether shadows fall on the object.")] = True
    visible: Annotated[
        bool, Option("Whether the camera sees the object; shadows and reflections do in any case.")
    ] = True

    def __post_init__(self) -> None:
        if self.transform is not None:
            matrix = checked_transform(self.transform, "transform")
            object.__setattr__(self, "transform", matrix)


@dataclass(frozen=True, kw_only=True, eq=False)
class Scene:
    """Everything that a picture is of.

    Attributes
    ----------
    objects : tuple of SceneObject
        At least one.
    lighting : Lighting
    view : View, optional
        None: as `RenderOptions` has it.
    name : str
        What messages call it: the name of its file.
    render : mapping
        Fields of `RenderOptions` that its file sets; `options` reads them.
    notes : tuple of str
        What its file asks for and is not shown, in words for people.
    files : tuple of Path
        That its file names: meshes, images, buffers. What writes pictures of it must spare them.
    """

    objects: tuple[SceneObject, ...]
    lighting: Lighting = field(default_factory=Lighting)
    view: View | None = None
    name: str = "scene"
    render: Mapping[str, Any] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    files: tuple[Path, ...] = ()

    def __post_init__(self) -> None:
        if not self.objects:
            raise OptionError(f"{self.name}: it has no objects; a scene needs at least one")

    def options(self, **changes: Any) -> RenderOptions:
        """Return the options that its file sets, with some changed and the others at default."""
        return replace(RenderOptions(), **{**self.render, **changes})


def checked_transform(transform: FloatArray, name: str) -> FloatArray:
    """Transform as a read-only (4, 4) float64.

    Raises
    ------
    OptionError
        It is not affine, or so singular that it flattens what it is applied to. `name` is what the
        message calls it.
    """
    matrix = np.array(transform, np.float64)
    if matrix.shape != (4, 4) or not np.isfinite(matrix).all():
        raise OptionError(f"{name}: it is not 4 x 4 finite numbers")
    if not np.array_equal(matrix[3], (0.0, 0.0, 0.0, 1.0)):
        raise OptionError(f"{name}: its last row is not 0, 0, 0, 1; only affine maps place objects")
    sizes = np.linalg.svd(matrix[:3, :3], compute_uv=False)
    if not sizes[2] > _SINGULAR * sizes[0]:
        raise OptionError(f"{name}: it is singular and flattens the object; stretch none by 0")
    return frozen(matrix)

"""Scenes, as read by `texbake preview SCENE.toml` and drawn by `render_scene`, and their cameras.

A mirroring transform also flips faces and tangents (see `texbake.mesh.compose`), so that an object
and its mirror image both show their outside, with the same relief.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import field, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from texbake.core import portable_math as pm
from texbake.errors import OptionError
from texbake.mapping.options import UnwrapOptions
from texbake.mesh.compose import transformed
from texbake.mesh.mesh import FloatArray, Mesh, frozen
from texbake.records import dataclass
from texbake.rendering.camera import Camera, axes_toward
from texbake.rendering.options import RenderOptions
from texbake.rendering.scene.lights import Lighting, Vector
from texbake.rendering.scene.material import Material
from texbake.schema import Option, check_fields, option

# Least allowed ratio of the smallest to the largest singular value. Rounding leaves a flattened
# axis at about 1e-16; above this limit it still has three significant digits.
_SINGULAR = 1e-13


@dataclass(frozen=True, kw_only=True)
class CameraView:
    """Where the camera stands.

    Either `position` and `target`, or (both None) `angles` about the middle of all objects, as far
    away as it takes to have them in the picture, as `RenderOptions.view` has it. What is None is
    as `RenderOptions` has it.
    """

    position: Vector | None = option(None, "Position of the camera in world space.")
    target: Vector | None = option(None, "Point that the camera looks at, in world space.")
    up: Vector | None = option(None, "Direction that is up in the picture, with a position.")
    angles: tuple[float, float] | tuple[float, float, float | None] | None = option(
        None, "Azimuth and elevation in degrees, and the distance in world units."
    )
    fov: float | None = option(None, "Vertical field of view in degrees.", above=0, below=180)
    near: float | None = option(
        None, "Distance of the near plane, with a position; small without it.", above=0
    )

    def __post_init__(self) -> None:
        check_fields(self)
        if (self.position is None) != (self.target is None):
            raise OptionError("camera: position and target belong together; give both or neither")
        if self.position is not None and self.angles is not None:
            raise OptionError("position: the angles say the same already; give one of them")
        for name in "up", "near":
            if getattr(self, name) is not None and self.position is None:
                raise OptionError(f"{name}: it belongs to a camera with a position; give that too")


@dataclass(frozen=True, kw_only=True, eq=False)
class SceneObject:
    """A mesh with a transform and a material.

    A `mapping` gives the mesh new texture coordinates when something reads them; see
    `apply_mapping`.
    """

    mesh: Annotated[Mesh, Option("Mesh in its own space.")]
    mapping: UnwrapOptions | None = option(None, "New texture coordinates for the mesh.")
    material: Annotated[Material, Option("Material of the object.")] = field(
        default_factory=Material
    )
    transform: FloatArray | None = option(None, "Matrix from the object's space to the world.")
    name: str = option("object", "Name of the object in messages and in the plan.")
    casts_shadows: bool = option(True, "Whether the object casts shadows.")
    receives_shadows: bool = option(True, "Whether shadows fall on the object.")
    visible: bool = option(
        True, "Whether the camera sees the object; shadows and reflections do in any case."
    )

    def __post_init__(self) -> None:
        if self.transform is not None:
            object.__setattr__(self, "transform", check_transform(self.transform, "transform"))

    def box_corners(self) -> FloatArray:
        """(8, 3) float64: corners of its bounding box in the world, before displacement."""
        corners = corners_of(self.mesh.bounds)
        if self.transform is None:
            return corners
        with np.errstate(over="ignore", invalid="ignore"):
            return np.asarray(pm.matmul(corners, self.transform[:3, :3].T) + self.transform[:3, 3])


@dataclass(frozen=True, kw_only=True, eq=False)
class Scene:
    """Everything that a picture is of.

    Attributes
    ----------
    objects : tuple of SceneObject
        At least one.
    lighting : Lighting
    view : CameraView, optional
        None uses the view of `RenderOptions`.
    name : str
        Name for messages: that of the file.
    render : mapping
        Fields of `RenderOptions` that the file sets; read by `options`.
    notes : tuple of str
        Features of the file that are not supported, as readable sentences.
    files : tuple of Path
        Files that the scene refers to: meshes, images, buffers. Output must not overwrite them.
    """

    objects: tuple[SceneObject, ...]
    lighting: Lighting = field(default_factory=Lighting)
    view: CameraView | None = None
    name: str = "scene"
    render: Mapping[str, Any] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    files: tuple[Path, ...] = ()

    def __post_init__(self) -> None:
        if not self.objects:
            raise OptionError(f"{self.name}: it has no objects; a scene needs at least one")

    def options(self, **changes: Any) -> RenderOptions:
        """Return the render options set in the file, with `changes` applied."""
        return replace(RenderOptions(), **{**self.render, **changes})

    def with_materials(self, change: Callable[[Material], Material]) -> Scene:
        """Return the scene with changed materials."""
        objects = tuple(replace(item, material=change(item.material)) for item in self.objects)
        return replace(self, objects=objects)

    def with_lighting(self, **changes: Any) -> Scene:
        """Return the scene with changed fields of its lighting."""
        return replace(self, lighting=replace(self.lighting, **changes))

    def with_lights(self, **changes: Any) -> Scene:
        """Return the scene with changed fields of all lights."""
        lights = tuple(replace(light, **changes) for light in self.lighting.lights)
        return self.with_lighting(lights=lights)

    def with_environment(self, **changes: Any) -> Scene:
        """Return the scene with changed fields of its environment, if it has one."""
        around = self.lighting.environment
        return (
            self if around is None else self.with_lighting(environment=replace(around, **changes))
        )


def corners_of(bounds: FloatArray) -> FloatArray:
    """(8, 3): corners of bounds (2, 3), ordered by their binary indices, x first."""
    return np.stack(np.meshgrid(*bounds.T, indexing="ij"), axis=-1).reshape(-1, 3)


def check_transform(transform: FloatArray, name: str) -> FloatArray:
    """Return a transform as a read-only (4, 4) float64 array."""
    matrix = np.array(transform, np.float64)
    if matrix.shape != (4, 4) or not np.isfinite(matrix).all():
        raise OptionError(f"{name}: it is not 4 x 4 finite numbers")
    if not np.array_equal(matrix[3], (0.0, 0.0, 0.0, 1.0)):
        raise OptionError(f"{name}: its last row is not 0, 0, 0, 1; only affine maps place objects")
    sizes, _ = pm.svd(matrix[:3, :3])
    if not sizes[2] > _SINGULAR * sizes[0]:
        raise OptionError(f"{name}: it is singular and flattens the object; stretch none by 0")
    return frozen(matrix)


def transform_matrix(
    *,
    translate: tuple[float, float, float] = (0.0, 0.0, 0.0),
    rotate: tuple[float, float, float] = (0.0, 0.0, 0.0),
    scale: float | tuple[float, float, float] = 1.0,
) -> FloatArray:
    """(4, 4) matrix that scales, rotates in degrees about x, y and z in turn, and translates."""
    linear = np.diag(np.broadcast_to(np.asarray(scale, np.float64), 3))
    for axis, angle in enumerate(rotate):
        cosine, sine = _cos_sin(angle)
        turn = np.eye(3)
        first, second = (axis + 1) % 3, (axis + 2) % 3
        turn[first, first] = turn[second, second] = cosine
        turn[first, second], turn[second, first] = -sine, sine
        linear = pm.matmul(turn, linear)
    matrix = np.eye(4)
    matrix[:3, :3] = linear
    matrix[:3, 3] = translate
    return matrix


def _cos_sin(degrees: float) -> tuple[float, float]:
    quarters, rest = divmod(degrees, 90.0)
    if rest == 0.0:
        return ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[int(quarters) % 4]
    return pm.cos(math.radians(degrees)), pm.sin(math.radians(degrees))


def apply_mapping(item: SceneObject, *, threads: int | None = None) -> SceneObject:
    """Return an object whose mesh has the coordinates from its mapping, if it has a mapping."""
    if item.mapping is None:
        return item
    # Imported here, since most scenes map nothing.
    from texbake.mapping.unwrap import unwrap

    return replace(item, mesh=unwrap(item.mesh, item.mapping, threads=threads), mapping=None)


def place_mesh(item: SceneObject) -> Mesh:
    """Return the mesh of an object in world space, without uvs that a mapping replaces."""
    mesh = item.mesh
    if item.mapping is not None and item.mapping.uv_set is None and item.mapping.only is None:
        mesh = mesh.replace(uvs=None, uv_faces=None, tangents=None)
    return mesh if item.transform is None else transformed(mesh, item.transform)


def outline(item: SceneObject) -> Mesh:
    """Return only faces and positions of an object in world space, for framing."""
    if item.transform is None:
        return item.mesh
    linear, translation = item.transform[:3, :3], item.transform[:3, 3]
    return Mesh(
        positions=pm.matmul(item.mesh.positions, linear.T) + translation,
        faces=item.mesh.faces,
        name=item.mesh.name,
    )


UP_AXES = {"y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
# Default near plane of a camera with a position, relative to the smaller of its distance to the
# target and the scene's radius.
_NEAR = 1e-3


def camera_of(scene: Scene, options: RenderOptions) -> Camera:
    """Return the camera of a scene's view."""
    view = scene.view or CameraView()
    fov = options.fov if view.fov is None else view.fov
    if view.position is None or view.target is None:
        angles = view.angles if view.angles is not None else options.view
        return Camera.framing(*_outlines(scene), options=replace(options, view=angles, fov=fov))
    near = view.near
    if near is None:
        _, radius = Camera.sphere_around(*_outlines(scene))
        near = _NEAR * min(
            radius, float(pm.norm(np.subtract(view.position, view.target))) or radius
        )
    return Camera.looking_at(
        view.position, view.target, up=_up_of(view, options), fov=math.radians(fov), near=near
    )


def check_view(scene: Scene) -> None:
    """Raise `OptionError` if the scene's own options and view do not make a valid camera."""
    view = scene.view
    if view is not None and view.position is not None and view.target is not None:
        axes_toward(view.position, view.target, _up_of(view, scene.options()))


def _up_of(view: CameraView, options: RenderOptions) -> Vector:
    return UP_AXES[options.up] if view.up is None else view.up


def turntable_cameras(scene: Scene, options: RenderOptions, n_views: int) -> list[Camera]:
    """Cameras that circle a scene once, as if it stood on a turntable."""
    if n_views < 1:
        raise OptionError(f"turntable: {n_views} views is out of range; it must be 1 or more")
    first = camera_of(scene, options)
    center, _ = Camera.sphere_around(*_outlines(scene))
    axis = np.array(UP_AXES[options.up])
    cameras = [first]
    for i in range(1, n_views):
        turn = _turn_about(axis, 2.0 * math.pi * i / n_views)
        cameras.append(
            Camera(
                eye=center + pm.matmul(turn, first.eye - center),
                axes=pm.matmul(first.axes, turn.T),
                fov=first.fov,
                near=first.near,
            )
        )
    return cameras


def _turn_about(axis: FloatArray, angle: float) -> FloatArray:
    """(3, 3): rotation about a unit axis, counter-clockwise seen from the tip of the axis."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    along = np.outer(axis, axis)
    return np.asarray(pm.cos(angle) * (np.eye(3) - along) + pm.sin(angle) * cross + along)


def _outlines(scene: Scene) -> list[Mesh]:
    """Visible objects in world space; all objects if none is visible."""
    seen = [item for item in scene.objects if item.visible]
    return [outline(item) for item in seen or scene.objects]

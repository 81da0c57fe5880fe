"""Rendering a mesh or a scene to a picture in one call."""

from __future__ import annotations

from collections.abc import Collection

from texbake.mesh.interchange import MeshLike, as_mesh
from texbake.progress import Progress
from texbake.rendering.camera import Camera
from texbake.rendering.draw import Prepared, draw, plan_of, prepare
from texbake.rendering.effect import Plan
from texbake.rendering.maps import MapSource
from texbake.rendering.options import RenderOptions
from texbake.rendering.resolve import Frame, expose
from texbake.rendering.scene.scene import Scene, camera_of
from texbake.rendering.studio import studio_scene
from texbake.sampling.rounds import BudgetClock


def render(
    mesh: MeshLike,
    *,
    normal_map: MapSource | None = None,
    displacement: MapSource | None = None,
    albedo: MapSource | None = None,
    options: RenderOptions | None = None,
    camera: Camera | None = None,
    threads: int | None = None,
    progress: Progress = None,
    clock: BudgetClock | None = None,
) -> Frame:
    """Render a mesh, optionally with maps, in studio light.

    Parameters
    ----------
    mesh
        Any mesh; maps need texture coordinates.
    normal_map : path, Image or (H, W, 3) float32, optional
        An array holds decoded unit vectors in tangent space, +Y up. The metadata of a file or image
        gives its space and convention; the default is tangent space, +Y up.
    displacement : path, Image or (H, W) float32, optional
        An array holds heights in model units. A file or image is decoded by its metadata; without
        metadata, its values are heights. The mesh is subdivided and displaced, and shaded with the
        normals of the displaced surface unless a normal map is given.
    albedo : path, Image or (H, W, 3) float32, optional
        An array holds linear colors.
    options
        None uses the defaults. Light is exposed only if `exposure` is `auto`.
    camera
        None frames the mesh (before displacement) by `options`.
    threads
        Number of threads; None uses every processor. The result does not depend on it.
    progress
        Receives the stages.
    clock
        When the time of `RenderOptions.time_budget` began, and what follows the picture. None
        starts it now, with nothing to follow.

    Returns
    -------
    Frame
        The picture, including its normals.

    Raises
    ------
    UvError
        A map is given for a mesh without texture coordinates.
    OptionError
        A map has another number of channels than it needs.
    FileError
        A map cannot be read.

    Examples
    --------
    >>> from texbake.mesh.shapes import cube
    >>> frame = render(cube(), options=RenderOptions(width=64, height=36))
    >>> frame.color.shape
    (36, 64, 4)
    """
    clock = clock or BudgetClock()
    mesh = as_mesh(mesh)
    options = options or RenderOptions()
    scene = studio_scene(
        mesh, normal_map=normal_map, displacement=displacement, albedo=albedo, options=options
    )
    prepared = prepare(scene, options, threads=threads)
    camera = camera or Camera.framing(mesh, options=options)
    return draw_picture(prepared, camera, keep=("normals",), progress=progress, clock=clock)


def render_scene(
    scene: Scene,
    options: RenderOptions | None = None,
    *,
    camera: Camera | None = None,
    threads: int | None = None,
    progress: Progress = None,
    clock: BudgetClock | None = None,
) -> Frame:
    """Render a scene.

    Only the effects that the scene calls for are computed.

    Parameters
    ----------
    scene
        A scene from `texbake.read_scene`, or built in Python.
    options
        None uses those of the scene, which a scene file sets under `[render]`.
    camera
        None uses the scene's view or, if it has none, frames all objects by `options`.
    threads
        Number of threads; None uses every processor. The result does not depend on it.
    progress
        Receives the stages.
    clock
        When the time of `RenderOptions.time_budget` began, and what follows the picture. None
        starts it now, with nothing to follow.

    Raises
    ------
    TexbakeError
        A texture cannot be read, or a mesh lacks data that its material needs.

    Examples
    --------
    >>> from texbake.mesh.shapes import cube
    >>> from texbake.rendering.scene.scene import SceneObject
    >>> scene = Scene(objects=(SceneObject(mesh=cube()),))
    >>> frame = render_scene(scene, RenderOptions(width=64, height=36))
    >>> [item.name for item in frame.plan.passes][:2]
    ['placing', 'slots']
    """
    clock = clock or BudgetClock()
    options = options or scene.options()
    prepared = prepare(scene, options, threads=threads)
    return draw_picture(
        prepared, camera or camera_of(scene, options), progress=progress, clock=clock
    )


def plan_scene(
    scene: Scene, options: RenderOptions | None = None, *, camera: Camera | None = None
) -> Plan:
    """Return the passes that a picture of a scene needs and why, without running them."""
    options = options or scene.options()
    return plan_of(prepare(scene, options), camera or camera_of(scene, options))


def draw_picture(
    prepared: Prepared,
    camera: Camera,
    *,
    keep: Collection[str] = (),
    progress: Progress = None,
    clock: BudgetClock | None = None,
) -> Frame:
    """Draw a prepared scene from one camera, with fixed or adaptive samples by its options."""
    if prepared.options.is_adaptive:
        # Imported here, so that pictures with fixed samples do not load it.
        from texbake.rendering.adaptive_pixels.samples import draw_adaptively

        frame = draw_adaptively(prepared, camera, keep=keep, progress=progress, clock=clock)
    else:
        frame = draw(prepared, camera, keep=keep, progress=progress)
    if not prepared.options.exposes:
        return frame
    return expose([frame], prepared.options, threads=prepared.threads)[0]

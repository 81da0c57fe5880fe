"""A mesh to a picture, with its maps.

    mesh ─ displace ─► triangles ─ rasterize ─► Visibility ─ shade ─► Shading ─ resolve ─► Frame

`load_model` does once what does not depend on the view (tangents, normals, displacement, reading
maps); `render_model` draws it from one camera. `render` is both in one call.
"""

from __future__ import annotations

from dataclasses import dataclass

from texbake.mesh.mesh import Mesh
from texbake.mesh.normals import shading_normals
from texbake.progress import ProgressSink, Stages
from texbake.render.camera import Camera
from texbake.render.displace import displace, on_base, segments_for
from texbake.render.maps import MapSource, albedo_from, heights_from, normals_from
from texbake.render.options import RenderOptions
from texbake.render.rasterize import rasterize
from texbake.render.resolve import Frame, resolve
from texbake.render.shade import shade
from texbake.render.surface import FloatImage, Surface
from texbake.texture.encoding import decode_srgb


@dataclass(frozen=True, kw_only=True, eq=False)
class Model:
    """A mesh ready to be drawn from any side.

    Attributes
    ----------
    mesh : Mesh
        The triangles to draw; displaced where there is a displacement.
    surface : Surface
        Of those triangles, or of the mesh they were cut from.
    segments : int, optional
        Pieces of each edge of the mesh that `surface` belongs to; None where it is that of `mesh`.
    """

    mesh: Mesh
    surface: Surface
    segments: int | None = None


def load_model(
    mesh: Mesh,
    *,
    normal_map: MapSource | None = None,
    displacement: MapSource | None = None,
    albedo: MapSource | None = None,
    options: RenderOptions | None = None,
    threads: int | None = None,
) -> Model:
    """Read the maps of a mesh and make what shading needs of it, and nothing that it does not.

    See `render` for the parameters and errors.
    """
    options = options or RenderOptions()
    vectors, space = (None, "") if normal_map is None else normals_from(normal_map)
    heights = None if displacement is None else heights_from(displacement)
    colors = None if albedo is None else albedo_from(albedo)
    if vectors is not None or heights is not None or colors is not None:
        mesh.corner_uvs()  # raises where there are none
    drawn, segments = mesh, None
    if heights is not None:
        segments = segments_for(
            mesh, heights.shape[1], heights.shape[0], max_triangles=options.max_triangles
        )
        drawn = displace(mesh, heights, segments=segments, threads=threads)
    # A normal map is relative to the mesh it was made for, displaced or not.
    shaded = mesh if vectors is not None else drawn
    normals, normal_faces = shading_normals(shaded, threads=threads)
    surface = Surface(
        normals=normals,
        normal_faces=normal_faces,
        base_color=linear(options.base_color),
        uvs=shaded.uvs,
        uv_faces=shaded.uv_faces,
        normal_map=vectors,
        tangents=_tangents(mesh) if vectors is not None and space == "tangent" else None,
        albedo=colors,
    )
    return Model(mesh=drawn, surface=surface, segments=segments if shaded is not drawn else None)


def render_model(
    model: Model,
    camera: Camera,
    *,
    options: RenderOptions | None = None,
    threads: int | None = None,
    progress: ProgressSink | None = None,
) -> Frame:
    """Draw a model from one camera; see `render`."""
    options = options or RenderOptions()
    width = options.width * options.supersampling
    height = options.height * options.supersampling
    stages = Stages(progress)
    with stages.stage("rasterize"):
        visibility = rasterize(
            model.mesh.positions,
            model.mesh.faces,
            camera.clip_from_world(width / height),
            width,
            height,
            back_faces=options.back_faces,
            threads=threads,
        )
    with stages.stage("shade"):
        seen = visibility
        if model.segments is not None:
            seen = on_base(visibility, segments=model.segments, threads=threads)
        shading = shade(seen, model.surface, camera, threads=threads)
        return resolve(
            visibility,
            shading,
            supersampling=options.supersampling,
            background=None if options.background is None else linear(options.background),
            near=camera.near,
            threads=threads,
        )


def render(
    mesh: Mesh,
    *,
    normal_map: MapSource | None = None,
    displacement: MapSource | None = None,
    albedo: MapSource | None = None,
    options: RenderOptions | None = None,
    camera: Camera | None = None,
    threads: int | None = None,
    progress: ProgressSink | None = None,
) -> Frame:
    """Render a mesh, with its maps where it has any.

    Parameters
    ----------
    mesh
        Any mesh; maps need texture coordinates.
    normal_map : path, Image or (H, W, 3) float32, optional
        An array holds decoded unit vectors in tangent space, +Y up; a file or image says in its
        metadata which space and convention it has, else it is taken for the same.
    displacement : path, Image or (H, W) float32, optional
        An array holds heights in model units; the metadata of a file or image says how to decode
        it, else its values are heights as they are. The mesh is cut into small triangles, which
        are moved; without a normal map their own normals shade them.
    albedo : path, Image or (H, W, 3) float32, optional
        An array holds linear colors.
    options
        None for the defaults.
    camera
        None for one that frames the mesh (before displacement) as `options` says.
    threads
        None for every processor; the bytes of the result do not depend on it.
    progress
        Told of the stages.

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
    options = options or RenderOptions()
    with Stages(progress).stage("prepare"):
        model = load_model(
            mesh,
            normal_map=normal_map,
            displacement=displacement,
            albedo=albedo,
            options=options,
            threads=threads,
        )
    camera = camera or Camera.framing(mesh, options=options)
    return render_model(model, camera, options=options, threads=threads, progress=progress)


def linear(color: tuple[float, float, float]) -> tuple[float, float, float]:
    """Linear light of an sRGB-coded color."""
    red, green, blue = (float(channel) for channel in decode_srgb(color))
    return red, green, blue


def _tangents(mesh: Mesh) -> FloatImage:
    """Tangents that came with the file, else MikkTSpace."""
    if mesh.tangents is not None:
        return mesh.tangents
    from texbake.mesh.tangents import corner_tangents

    return corner_tangents(mesh)

"""What the commands that make textures and pictures give, as quantities with their bounds."""

from __future__ import annotations

import numpy as np
from invariance.changes import (
    CORNERS,
    FACES,
    MIRROR,
    ORDERS,
    PLACE,
    QUARTER,
    SCALE,
    SHIFT,
    TURN,
    VERTICES,
)
from invariance.mesh_commands import Command, Result
from invariance.quantities import (
    CORNER,
    COUNT,
    CURVATURE,
    EXACT,
    FACE,
    LENGTH,
    NUMBER,
    PICTURE,
    POINT,
    ROUNDING,
    SAME,
    Bounds,
    Quantity,
    Side,
    counts,
    number,
    within,
)

import texbake
from texbake.baking.result import BakedMap
from texbake.baking.texture.options import PhotoOptions, SolidOptions
from texbake.baking.texture.photo import Photo, PhotoCamera
from texbake.baking.texture.photos import bake_photos
from texbake.baking.texture.solid import bake_solid
from texbake.jobs.uv_pictures import render_checker
from texbake.mapping.layout_svg import layout_svg
from texbake.mapping.options.projection import SURFACES, VIAS
from texbake.mapping.overlap import find_overlaps
from texbake.rendering.camera import Camera

# The camera stands at a place that is rounded: no pixel looks different.
UNSEEN = 1e-9


def charted(**options: object) -> Command:
    """An atlas."""

    def unwrap(side: Side) -> Result:
        mesh = texbake.unwrap(side.mesh, size=128, padding=1, threads=1, **options)
        measured = texbake.distortion(mesh, 128, threads=1)
        # Charts are cut and joined along other edges where several cost the same. A box that
        # lies otherwise is one chart or three.
        return {
            "uvs": Quantity(values=mesh.corner_uvs(), per=CORNER, bounds=EXACT),
            **counts(n_overlapping=measured.n_overlapping, n_mirrored=measured.n_mirrored),
            "n_charts": number(measured.n_charts, within(2.0), COUNT),
            "stretch": number(measured.stretch.l2, within(0.1), COUNT),
        }

    return unwrap


def classical(method: str, **options: object) -> Command:
    """A classical mapping, with its axis turned with the mesh."""
    # The axis of a cylinder is a point of the model, rounded where it is; and where the surface
    # leads past the tangent of a cylinder, the square root of that counts.
    is_round = method == "cylindrical" or options.get("surface") == "cylinder"
    exact = {SCALE: 0.0, PLACE: 1e-7 if is_round else 0.0}
    if "reflection" in options.values():  # the eye is a point of the model, too
        exact[PLACE] = 1e-7
    bounds = {**exact, **dict.fromkeys(ORDERS, 1e-12)}

    def unwrap(side: Side) -> Result:
        more = dict(options)
        if options.get("via") == "reflection":
            more["eye"] = side.beside((3.0, 2.0, 1.0))
        mesh = texbake.unwrap(side.mesh, method=method, threads=1, **more)
        return {"uvs": Quantity(values=mesh.corner_uvs(), per=CORNER, bounds=bounds)}

    return unwrap


UNITS = {
    "displacement": LENGTH, "vector-displacement": LENGTH, "thickness": LENGTH,
    "curvature": CURVATURE, "convexity": CURVATURE, "concavity": CURVATURE,
}  # fmt: skip
MAPS = (
    "normal", "displacement", "vector-displacement", "curvature", "convexity", "concavity",
    "object-id", "opacity", "ao", "bent-normal", "thickness",
)  # fmt: skip
# A ray more or less meets another face at the outline of one.
FEW_TEXELS = within(0.05, mirror=None)
# The rays around a hit do not turn with the mesh, and depend on the place in the low-poly face.
# They are few, so that only their mean over the map is exact.
OCCLUDED = within(
    0.05, mirror=None, turn=None, quarter_turn=None, order_of_faces=None, order_of_corners=None
)
MEAN_OCCLUDED = within(0.02, mirror=0.05)


def _maps(maps: dict[str, BakedMap]) -> Result:
    found = {}
    for name, item in maps.items():
        if name.endswith("position"):
            # Places in float32, up to 2^11 sizes away.
            values = np.where(item.has_data[..., None], item.values, np.nan)
            bounds: Bounds = {SCALE: 0.0, PLACE: 2.0**11 * 2.0**-23}
            found[name] = Quantity(values=values, unit=POINT, bounds=bounds)
        elif name in ("normal", "ao") and item.options.space == "tangent":
            bounds = OCCLUDED if name == "ao" else FEW_TEXELS
            found[name] = Quantity(values=item.values, unit=PICTURE, bounds=bounds)
            if name == "ao":
                mean = item.values[item.has_data].mean() if item.has_data.any() else 0.0
                found["mean ao"] = number(mean, MEAN_OCCLUDED)
        else:
            found[name] = Quantity(values=item.values, unit=UNITS.get(name, NUMBER), bounds=EXACT)
    return found


def baked(*maps: str, **options: object) -> Command:
    """A bake of the larger mesh onto the mesh itself."""

    def bake(side: Side) -> Result:
        wanted = texbake.BakeOptions(size=32, maps=maps, threads=1, **options)
        result = texbake.bake(side.high, side.mesh, wanted)
        n_texels = result.texel_faces.size
        n_covered = np.count_nonzero(result.texel_faces >= 0)
        reach = max(result.report.front or 0.0, result.report.back)
        return {
            **_maps(result.maps),
            # The sides of faces that lie on centers of texels change places in a mirror.
            "covered": number(n_covered / n_texels, {**SAME, MIRROR: None}),
            "missed": number(np.count_nonzero(result.missed) / n_texels, within(0.02, mirror=0.05)),
            # Measured at samples, which lie elsewhere on faces in another order.
            "reach": number(reach, within(0.02), LENGTH),
        }

    return bake


def remapped(side: Side) -> Result:
    options = texbake.BakeOptions(size=32, maps=("normal",), threads=1, keep_hits=True)
    kept = texbake.bake(side.high, side.mesh, options)
    others = texbake.BakeOptions(
        size=32, maps=("displacement", "normal"), space="object", threads=1
    )
    return _maps(texbake.remap(kept, side.high, side.mesh, others).maps)


def parts(side: Side) -> Result:
    options = texbake.BakeOptions(size=32, maps=("normal", "displacement"), threads=1)
    result = texbake.bake_parts([side.high], [side.mesh], options)
    return {
        f"{index} {name}": item
        for index, target in enumerate(result.targets.values())
        for name, item in _maps(target.maps).items()
    }


def solid(procedure: str) -> Command:
    """A procedure, which fills the space of the model: a mesh that moves, moves through it."""
    bounds = {SCALE: 0.0, VERTICES: 0.0, FACES: 0.0, CORNERS: 0.01}

    def bake_texture(side: Side) -> Result:
        options = SolidOptions(procedure=procedure, size=32, threads=1)
        values = bake_solid(side.mesh, options).values
        return {"values": Quantity(values=values, unit=PICTURE, bounds=bounds)}

    return bake_texture


def photographed(side: Side) -> Result:
    image = np.random.default_rng(3).random((16, 16, 3)).astype(np.float32)
    camera = PhotoCamera(
        position=side.beside((0.5, 1.0, 3.0)),
        target=side.middle,
        up=side.direction((0.0, 1.0, 0.0)),
    )
    options = PhotoOptions(size=32, threads=1)
    result = bake_photos(side.mesh, [Photo(image=image, camera=camera)], options)
    return {
        "values": Quantity(values=result.values, unit=PICTURE, bounds=FEW_TEXELS),
        "seen": Quantity(values=result.has_color, unit=PICTURE, bounds=FEW_TEXELS),
    }


def lit(side: Side) -> Result:
    sun = texbake.Light(direction=side.direction((-1.0, -2.0, -1.5)))
    lighting = texbake.Lighting(lights=(sun,), ambient=texbake.Ambient(color=(0.1, 0.1, 0.1)))
    scene = texbake.Scene(objects=(texbake.SceneObject(mesh=side.mesh),), lighting=lighting)
    result = texbake.bake_light_maps(scene, texbake.BakeOptions(size=16, threads=1))
    return {
        item.name: Quantity(values=item.values, unit=PICTURE, bounds=FEW_TEXELS)
        for item in result.maps
    }


def _camera(side: Side, options: texbake.RenderOptions) -> Camera | None:
    """The camera that frames the mesh, turned with it."""
    if np.array_equal(side.linear, np.eye(3)):
        return None
    upright = side.mesh.replace(positions=side.mesh.positions @ side.linear)
    framed = Camera.framing(upright, options=options)
    return Camera(
        eye=side.linear @ framed.eye, axes=framed.axes @ side.linear.T, fov=framed.fov,
        near=framed.near,
    )  # fmt: skip


def picture(**more: object) -> Command:
    """A preview."""
    # Pixels along the edges of triangles.
    bounds = within(0.05, exact_shift=UNSEEN, mirror=None)
    # More light comes from above, which does not turn with the mesh.
    colors = {**bounds, QUARTER: None, TURN: None}

    def preview(side: Side) -> Result:
        options = texbake.RenderOptions(width=48, height=36, **more)
        camera = _camera(side, options)
        frame = texbake.render(side.mesh, options=options, camera=camera, threads=1)
        return {
            "color": Quantity(values=frame.color, unit=PICTURE, bounds=colors),
            "coverage": Quantity(values=frame.coverage, unit=PICTURE, bounds=bounds),
            "faces": Quantity(values=frame.face_ids, bounds=EXACT),
        }

    return preview


def checker(side: Side) -> Result:
    options = texbake.RenderOptions(width=24, height=18)
    values = render_checker(side.mesh, options, threads=1)
    bounds = {SCALE: 0.0, PLACE: UNSEEN, **dict.fromkeys(ORDERS, 0.05)}
    return {"color": Quantity(values=values, unit=PICTURE, bounds=bounds)}


def layout(side: Side) -> Result:
    pixels = texbake.draw_layout(side.mesh, 64, heat=True, threads=1)
    svg = layout_svg(side.mesh, 64, heat=True)
    return {
        # Lines that lie on one another are drawn in the order of the faces.
        "pixels": Quantity(values=pixels, unit=PICTURE, bounds=within(0.1, mirror=None)),
        "svg": Quantity(values=np.array(svg), bounds=EXACT),
    }


def compare(side: Side) -> Result:
    options = texbake.RenderOptions(width=32, height=24)
    found = texbake.compare(
        side.high, side.mesh, options=options, views=[(30.0, 20.0), (200.0, -10.0)], threads=1
    )
    bare = found.bare
    # Views do not turn with the mesh.
    bounds = {SCALE: 0.0, PLACE: 1e-4, SHIFT: 0.5, **dict.fromkeys(ORDERS, 0.5)}
    share = {kind: bound and bound / 10.0 for kind, bound in bounds.items()}
    return {
        "mean angle": number(bare.mean_deg, bounds),
        "similarity": number(bare.ssim, share),
        "outline": number(bare.outline_mismatch + bare.depth_mismatch, share),
    }


def distort(side: Side) -> Result:
    found = texbake.distortion(side.mesh, 64, threads=1)
    overlaps = find_overlaps(side.mesh.corner_uvs(), threads=1)
    return {
        **counts(n_charts=found.n_charts, n_degenerate=found.n_degenerate,
                 n_collapsed=found.n_collapsed, n_overlapping=found.n_overlapping),
        "overlapping": Quantity(values=overlaps.overlapping, per=FACE, bounds=SAME),
        "stretch": number(
            found.stretch.l2, within(ROUNDING * 10.0, mirror=None), COUNT, amplified=8.0),
        "seam": number(found.seam_length, within(ROUNDING * 10.0), LENGTH, amplified=8.0),
        "density": number(found.texel_density, within(1e-9), CURVATURE, amplified=64.0),
        "fill": number(found.fill, within(ROUNDING * 10.0)),
    }  # fmt: skip


PLAIN: dict[str, Command] = {
    "unwrap fast": charted(quality="fast"),
    "unwrap best": charted(quality="best"),
    "unwrap by xatlas": charted(charts="xatlas"),
    **{f"unwrap {name}": classical(name)
       for name in ("planar", "cylindrical", "spherical", "box", "projector")},
    "unwrap planar, pca": classical("planar", fit="pca"),
    "unwrap planar, sides": classical("planar", sides=True),
    "unwrap cylindrical, caps": classical("cylindrical", caps=True),
    **{f"unwrap two-part, {surface}, {via}": classical("two-part", surface=surface, via=via)
       for surface in SURFACES for via in VIAS},
    "preview": picture(),
    "preview of back faces": picture(back_faces="show"),
    "compare": compare,
}  # fmt: skip
TEXTURED: dict[str, Command] = {
    "unwrap parametric": classical("parametric"),
    "unwrap keep": charted(keep=True),
    "bake": baked(*MAPS),
    "bake in object space": baked("normal", "bent-normal", "position", space="object"),
    "bake of closest points": baked("normal", "displacement", on_miss="closest", rays="vertex"),
    "bake of adaptive samples": baked("normal", "displacement", samples="adaptive"),
    "bake of parts": parts,
    "remap": remapped,
    "bake-texture marble": solid("marble"),
    "bake-texture checker": solid("checker"),
    "bake-texture of a photograph": photographed,
    "bake-lightmap": lit,
    "checker": checker,
    "layout": layout,
    "distortion": distort,
}

"""The result of every command, as quantities with their bounds (see `invariance`).

Where a command chooses (the next edge to collapse, the cut of a chart), a rotation or another order
breaks ties differently. The bounds are then those of the quality of the result.
"""

import numpy as np
from invariance import (
    AREA,
    COMPUTED,
    CORNER,
    COUNT,
    CURVATURE,
    DIRECTION,
    FACE,
    FLOAT32,
    LENGTH,
    NUMBER,
    PICTURE,
    POINT,
    ROUNDING,
    VERTEX,
    Quantity,
    fixed,
    number,
)

import texbake
from texbake.baking.texture.options import PhotoOptions, SolidOptions
from texbake.baking.texture.photos import Photo, PhotoCamera, bake_photos
from texbake.baking.texture.solid import bake_solid
from texbake.jobs.export.export import share_elsewhere
from texbake.jobs.side_pictures import render_checker
from texbake.mapping.layout_svg import layout_svg
from texbake.mapping.options.projection import SURFACES, VIAS
from texbake.mapping.overlap import find_overlaps
from texbake.mesh.normals import face_normals, smooth_normals, vertex_curvatures
from texbake.mesh.tangents import corner_tangents
from texbake.raycast.orientation import oriented
from texbake.rendering.camera import Camera

# The camera stands at a place that is rounded: no pixel looks different.
UNSEEN = 1e-9


def info(side):
    found = texbake.mesh_info(side.mesh)
    names = (
        "n_vertices", "n_faces", "n_components", "n_boundary_edges", "n_non_manifold_edges",
        "n_misoriented_edges", "n_degenerate_faces", "n_duplicate_faces", "n_unused_vertices",
        "n_split_vertices", "closed",
    )  # fmt: skip
    return {
        **fixed(genus=-1 if found.genus is None else found.genus),
        **fixed(**{name: getattr(found, name) for name in names}),
        "diagonal": number(found.diagonal, ROUNDING, LENGTH),
        "area": number(found.area, ROUNDING, AREA),
        "bounds": Quantity(values=np.array(found.bounds), unit=POINT, order=0.0),
    }


def normals(side):
    same = {"unit": DIRECTION, "turn": ROUNDING, "order": ROUNDING}
    mesh = side.mesh
    # Curvature divides by areas, and so amplifies what sums round once more.
    curvature = Quantity(
        values=vertex_curvatures(mesh), unit=CURVATURE, per=VERTEX, turn=1e-6, order=1e-6
    )
    return {
        "faces": Quantity(values=face_normals(mesh), per=FACE, **same),
        "smooth": Quantity(values=smooth_normals(mesh), per=VERTEX, **same),
        "curvature": curvature,
    }


def tangents(side):
    # Directions are float32, and MikkTSpace divides by areas in the texture.
    values = corner_tangents(side.mesh)[..., :3]
    return {"tangents": Quantity(values=values, unit=DIRECTION, per=CORNER, turn=1e-5, order=1e-5)}


def findings(*meshes):
    report = texbake.check(*meshes, options=texbake.CheckOptions(size=64))
    of_place = {"far-from-origin", "extreme-size", "unmeasurable-size"}
    found = sorted(
        f"{finding.mesh} {finding.kind.name} {finding.severity} {finding.count}"
        for finding in report.findings
        if finding.kind.name not in of_place
    )
    return fixed(findings=np.array(found or [""], dtype="U120"))


def repair(side):
    mesh, report = texbake.repair(side.mesh)
    return {
        **fixed(n_faces=mesh.n_faces),
        **fixed(**{name.replace(" ", "_"): count for name, count in report.counts.items()}),
        "faces": Quantity(values=mesh.faces),
        "positions": Quantity(values=mesh.positions, unit=POINT),
    }


def transform(side):
    """The normals, which the size of a mesh does not change, and neither does its order."""
    options = texbake.TransformOptions(scale=2.0, rotate=(90.0, 0.0, 30.0), flip=True)
    values = face_normals(texbake.transform(side.mesh, options))
    return {"normals": Quantity(values=values, per=FACE, place=None, order=ROUNDING)}


def points_of(mesh):
    return {
        "faces": Quantity(values=mesh.faces),
        "positions": Quantity(values=mesh.positions, unit=POINT, place=COMPUTED),
    }


def apart(one, other, bound):
    distance = texbake.surface_distance(one, other, n_samples=300, threads=1).max
    return number(distance, bound, LENGTH, place=1e-11)


def remesh(side):
    mesh = texbake.remesh(side.mesh, texbake.RemeshOptions(resolution=16), threads=1)
    # The diagonal of a voxel: the grid lies otherwise about a mesh that is turned.
    return {**points_of(mesh), "distance": apart(mesh, side.mesh, 3.0**0.5 / 16.0)}


def simplified(quality, error=None):
    """Simplify to half the faces, or to an error."""

    def simplify(side):
        n_faces = None if error else max(4, side.mesh.n_faces // 2)
        low = texbake.simplify(side.mesh, n_faces, error=error, quality=quality, threads=1)
        # Other edges collapse where several cost the same.
        return {
            **points_of(low),
            "n_faces": number(low.n_faces, 0.5, COUNT),
            "distance": apart(low, side.mesh, 0.25),
        }

    return simplify


def cage(side):
    found = texbake.fit_cage(side.high, side.mesh, threads=1)
    # The margin is a share of the bounding box, which turns change. Vertices move in one by one,
    # so that where each one stops depends on their order.
    return {
        "distances": Quantity(
            values=found.distances, unit=LENGTH, per=VERTEX, turn=2.5e-4, order=2e-3
        )
    }


def distances(side):
    found = texbake.surface_distance(side.high, side.mesh, n_samples=300, threads=1)
    # Samples lie elsewhere on faces in another order, or with another first corner.
    return {
        name: number(getattr(found, name), unit=LENGTH, turn=ROUNDING, order=0.02)
        for name in ("max", "rms", "mean")
    }


def orientation(side):
    mesh, report = oriented(side.mesh, "auto", threads=1)
    turned = (mesh.faces != side.mesh.faces).any(axis=1)
    return {
        "turned": Quantity(values=turned, per=FACE, turn=0.0, order=0.0),
        # The directions from which a mesh is looked at do not turn with it, and a sheet between
        # two others is seen from one side or the other.
        "n_unclear": number(report.n_unclear),
    }


def levels(side):
    n_faces = max(4, side.mesh.n_faces // 2)
    level = texbake.simplify(side.mesh, n_faces, seams="keep", threads=1)
    share = np.nan if level.uvs is None else share_elsewhere(level, side.mesh, threads=1)
    # Samples of the simplified mesh are rounded where it is.
    return {"elsewhere": number(share, place=0.01)}


def charted(**options):
    """An atlas."""

    def unwrap(side):
        mesh = texbake.unwrap(side.mesh, size=128, padding=1, threads=1, **options)
        measured = texbake.distortion(mesh, 128, threads=1)
        # Charts are cut and joined along other edges where several cost the same. A box that
        # lies otherwise is one chart or three.
        return {
            "uvs": Quantity(values=mesh.corner_uvs(), per=CORNER),
            **fixed(n_overlapping=measured.n_overlapping, n_mirrored=measured.n_mirrored),
            "n_charts": number(measured.n_charts, 2.0, COUNT),
            "stretch": number(measured.stretch.l2, 0.1, COUNT),
        }

    return unwrap


def classical(method, **options):
    # The axis of a cylinder, and the eye of a reflection, are points of the model, rounded where it
    # is; and where the surface leads past the tangent of a cylinder, the square root of that
    # counts.
    is_round = method == "cylindrical" or options.get("surface") == "cylinder"
    place = 1e-7 if is_round or options.get("via") == "reflection" else 0.0

    def unwrap(side):
        eye = {"eye": side.beside((3.0, 2.0, 1.0))} if options.get("via") == "reflection" else {}
        mesh = texbake.unwrap(side.mesh, method=method, threads=1, **options, **eye)
        return {"uvs": Quantity(values=mesh.corner_uvs(), per=CORNER, place=place, order=1e-12)}

    return unwrap


UNITS = {
    "displacement": LENGTH, "vector-displacement": LENGTH, "thickness": LENGTH,
    "curvature": CURVATURE, "convexity": CURVATURE, "concavity": CURVATURE,
}  # fmt: skip
MAPS = (
    "normal", "displacement", "vector-displacement", "curvature", "convexity", "concavity",
    "object-id", "opacity", "ao", "bent-normal", "thickness",
)  # fmt: skip


def few(values):
    """A map; a ray more or less meets another face at the outline of one."""
    return Quantity(values=values, unit=PICTURE, turn=0.05, order=0.05)


def maps_of(maps):
    found = {}
    for name, item in maps.items():
        if name.endswith("position"):
            values = np.where(item.has_data[..., None], item.values, np.nan)
            found[name] = Quantity(values=values, unit=POINT, place=FLOAT32)
        elif name == "normal" and item.options.space == "tangent":
            found[name] = few(item.values)
        else:
            found[name] = Quantity(values=item.values, unit=UNITS.get(name, NUMBER))
        if name == "ao":
            # The rays around a hit do not turn with the mesh, and depend on the place in the
            # low-poly face. They are few, so that only their mean over the map is exact.
            mean = item.values[item.has_data].mean() if item.has_data.any() else 0.0
            found["mean ao"] = number(mean, 0.02)
    return found


def baked(*maps, **options):
    """A bake of the larger mesh onto the mesh itself."""

    def bake(side):
        wanted = texbake.BakeOptions(size=32, maps=maps, threads=1, **options)
        result = texbake.bake(side.high, side.mesh, wanted)
        return {
            **maps_of(result.maps),
            **fixed(covered=np.count_nonzero(result.texel_faces >= 0)),
            "missed": number(np.count_nonzero(result.missed) / result.missed.size, 0.02),
            # Measured at samples, which lie elsewhere on faces in another order.
            "reach": number(max(result.report.front or 0.0, result.report.back), 0.02, LENGTH),
        }

    return bake


def remapped(side):
    same = {"size": 32, "threads": 1}
    options = texbake.BakeOptions(maps=("normal",), keep_hits=True, **same)
    kept = texbake.bake(side.high, side.mesh, options)
    others = texbake.BakeOptions(maps=("displacement", "normal"), space="object", **same)
    return maps_of(texbake.remap(kept, side.high, side.mesh, others).maps)


def parts(side):
    options = texbake.BakeOptions(size=32, maps=("normal", "displacement"), threads=1)
    result = texbake.bake_parts([side.high], [side.mesh], options)
    return {
        f"{index} {name}": item
        for index, target in enumerate(result.targets.values())
        for name, item in maps_of(target.maps).items()
    }


def solid(procedure):
    """A procedure, which fills the space of the model: a mesh that moves, moves through it."""

    def bake_texture(side):
        options = SolidOptions(procedure=procedure, size=32, threads=1)
        values = bake_solid(side.mesh, options).values
        return {"values": Quantity(values=values, unit=PICTURE, place=None, order=0.01)}

    return bake_texture


def photographed(side):
    image = np.random.default_rng(3).random((16, 16, 3)).astype(np.float32)
    camera = PhotoCamera(
        position=side.beside((0.5, 1.0, 3.0)),
        target=side.middle,
        up=side.direction((0.0, 1.0, 0.0)),
    )
    options = PhotoOptions(size=32, threads=1)
    result = bake_photos(side.mesh, [Photo(image=image, camera=camera)], options)
    return {"values": few(result.values), "seen": few(result.has_color)}


def lit(side):
    sun = texbake.Light(direction=side.direction((-1.0, -2.0, -1.5)))
    lighting = texbake.Lighting(lights=(sun,), ambient=texbake.Ambient(color=(0.1, 0.1, 0.1)))
    scene = texbake.Scene(objects=(texbake.SceneObject(mesh=side.mesh),), lighting=lighting)
    result = texbake.bake_light_maps(scene, texbake.BakeOptions(size=16, threads=1))
    return {item.name: few(item.values) for item in result.maps}


def turned_camera(side, options):
    """The camera that frames the mesh, turned with it."""
    if np.array_equal(side.linear, np.eye(3)):
        return None
    upright = side.mesh.replace(positions=side.mesh.positions @ side.linear)
    framed = Camera.framing(upright, options=options)
    return Camera(
        eye=side.linear @ framed.eye, axes=framed.axes @ side.linear.T, fov=framed.fov,
        near=framed.near,
    )  # fmt: skip


def picture(**more):
    """A preview."""

    def preview(side):
        options = texbake.RenderOptions(width=48, height=36, **more)
        camera = turned_camera(side, options)
        frame = texbake.render(side.mesh, options=options, camera=camera, threads=1)
        # Pixels along the edges of triangles; more light comes from above, which does not turn
        # with the mesh.
        seen = {"unit": PICTURE, "place": UNSEEN, "order": 0.05}
        return {
            "color": Quantity(values=frame.color, **seen),
            "coverage": Quantity(values=frame.coverage, turn=0.05, **seen),
            "faces": Quantity(values=frame.face_ids),
        }

    return preview


def checker(side):
    options = texbake.RenderOptions(width=24, height=18)
    values = render_checker(side.mesh, options, threads=1)
    return {"color": Quantity(values=values, unit=PICTURE, place=UNSEEN, order=0.05)}


def layout(side):
    pixels = texbake.draw_layout(side.mesh, 64, heat=True, threads=1)
    return {
        # Lines that lie on one another are drawn in the order of the faces.
        "pixels": Quantity(values=pixels, unit=PICTURE, turn=0.1, order=0.1),
        "svg": Quantity(values=np.array(layout_svg(side.mesh, 64, heat=True))),
    }


def compare(side):
    """From views that do not turn with the mesh."""
    options = texbake.RenderOptions(width=32, height=24)
    views = [(30.0, 20.0), (200.0, -10.0)]
    bare = texbake.compare(side.high, side.mesh, options=options, views=views, threads=1).bare
    return {
        "mean angle": number(bare.mean_deg, place=1e-4, order=0.5),
        "similarity": number(bare.ssim, place=1e-5, order=0.05),
        "outline": number(bare.outline_mismatch + bare.depth_mismatch, place=1e-5, order=0.05),
    }


def distort(side):
    found = texbake.distortion(side.mesh, 64, threads=1)
    overlapping = find_overlaps(side.mesh.corner_uvs(), threads=1).overlapping
    return {
        **fixed(n_charts=found.n_charts, n_degenerate=found.n_degenerate,
                n_collapsed=found.n_collapsed, n_overlapping=found.n_overlapping),
        "overlapping": Quantity(values=overlapping, per=FACE, turn=0.0, order=0.0),
        "stretch": number(found.stretch.l2, 10.0 * ROUNDING, COUNT),
        "seam": number(found.seam_length, 10.0 * ROUNDING, LENGTH),
        "density": number(found.texel_density, 1e-9, CURVATURE),
        "fill": number(found.fill, 10.0 * ROUNDING),
    }  # fmt: skip


PLAIN = {
    "info": info,
    "normals": normals,
    "check": lambda side: findings(side.mesh),
    "repair": repair,
    "transform": transform,
    "remesh": remesh,
    "simplify fast": simplified("fast"),
    "simplify best": simplified("best"),
    "simplify to an error": simplified("best", "2%"),
    "cage": cage,
    "surface distance": distances,
    "orientation": orientation,
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
# They are given texture coordinates where they have none.
TEXTURED = {
    "check of a pair": lambda side: findings(side.high, side.mesh),
    "tangents": tangents,
    "levels of detail": levels,
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

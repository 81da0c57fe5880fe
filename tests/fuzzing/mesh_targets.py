"""Targets of the fuzzer that take meshes: their surface, repair, unwrapping, rays and bakes.

A target raises an error of one line, or returns a result that obeys the laws of all results.
"""

import tempfile
from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

import numpy as np

import texbake as tb
from texbake.baking.bake import remap_hits
from texbake.baking.maps import MAP_NAMES, MATERIAL_MAPS
from texbake.baking.texture.options import PhotoOptions, SolidOptions
from texbake.baking.texture.photos import Photo, PhotoCamera, bake_photos
from texbake.baking.texture.solid import bake_solid
from texbake.mapping.atlas.cutting import cut
from texbake.mapping.layout_svg import layout_svg
from texbake.mapping.options import METHODS
from texbake.mapping.overlap import find_overlaps, overlap_layers
from texbake.mesh import piecewise
from texbake.mesh.frame import LocalFrame
from texbake.mesh.materials import ChannelImage, ChannelSource, Materials, MeshMaterial
from texbake.mesh.normals import face_normals, smooth_normals, vertex_curvatures
from texbake.mesh.shapes import orange, plane, uv_sphere
from texbake.mesh.streamed.mesh import open_streamed
from texbake.mesh.tangents import corner_tangents
from texbake.mesh.triangle_tree import TriangleTree
from texbake.mesh.weld import weld_rows
from texbake.mesh.wrapping import remesh_with_few_tunnels
from texbake.raycast.orientation import oriented
from texbake.raycast.rays import Hemispheres, OcclusionRange, Rays, direction_sets
from texbake.raycast.scene import RayPlaces, RayScene

MAPS = ("normal", "normal", "displacement", *(n for n in MAP_NAMES if n not in MATERIAL_MAPS))
CHANNELS = ("normal", "base-color", "roughness", "material-id")
WRAPS = ("repeat", "mirror", "clamp")
SIZES = (1, 2, 7, 16, 33, 64)


def require_finite(*arrays):
    for values in arrays:
        assert np.isfinite(values).all()


def require_unit(vectors, *, or_zero=False):
    lengths = np.linalg.norm(vectors.astype(np.float64), axis=-1)
    assert ((np.abs(lengths - 1.0) < 2e-7) | (or_zero & (lengths == 0.0))).all()


def files(drawn):
    """A mesh written and read again, bit for bit, or to a rounding of float32."""
    mesh, suffix = drawn.mesh(most=20), drawn.pick(("obj", "ply", "off", "stl", "glb"))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"mesh.{suffix}"
        tb.write_mesh(mesh, path)
        back = tb.read_mesh(path)
    off = np.abs(back.positions[back.faces] - mesh.positions[mesh.faces]).max()
    far = np.abs(mesh.positions[mesh.faces]).max()
    assert off <= (far * 2.0**-23 + 1e-45 if suffix in ("stl", "glb") else 0.0)
    if suffix in ("obj", "ply") and mesh.uvs is not None:
        assert np.array_equal(back.corner_uvs(), mesh.corner_uvs())


def surface(drawn):
    """Normals, curvatures, tangents and topology; rows that are equal."""
    mesh = drawn.mesh(most=40)
    for normals in face_normals(mesh), smooth_normals(mesh):
        require_unit(normals, or_zero=True)
    require_finite(vertex_curvatures(mesh))
    assert tb.mesh_info(mesh).n_degenerate_faces <= mesh.n_faces
    if mesh.uvs is not None:
        require_unit(corner_tangents(mesh)[..., :3])
    weld_rows(drawn.floats(1 + drawn.below(40), 1 + drawn.below(4)))


def repair(drawn):
    mesh = drawn.mesh(most=40)
    names = ("merge", "degenerate", "duplicates", "winding", "coordinates")
    whole, _ = tb.repair(mesh, drawn.options(tb.RepairOptions, *names))
    require_finite(whole.positions)
    if drawn.rarely(16):
        oriented(mesh, "auto", keep_open=drawn.flag())


def simplify(drawn):
    mesh = drawn.mesh(most=60)
    quality, seams = drawn.pick(("fast", "best")), drawn.pick(("auto", "keep", "drop"))
    error = drawn.pick((*[None] * 31, "1%", "20%"))  # a search takes a second
    n_faces = 4 + drawn.below(60) if error is None else None
    low = tb.simplify(mesh, n_faces, error=error, quality=quality, seams=seams)
    require_finite(low.positions)
    assert low.n_faces <= mesh.n_faces


def pieces(drawn):
    """Pieces of a large mesh, reduced each for itself; here they are small ones."""
    mesh = drawn.mesh(most=100)
    with (
        patch.object(piecewise, "_START_FACES", 4 + drawn.below(40)),
        patch.object(piecewise, "_PIECE", 8 + drawn.below(40)),
    ):
        tb.simplify(mesh, 4, quality=drawn.pick(("fast", "best")))


def parts(drawn):
    """The parts of a large mesh that are cut each for itself; here they are small ones."""
    mesh = drawn.mesh(most=60)
    small = cut._Quality(part_faces=4 + drawn.below(12), whole_faces=6, most_l2=1.06,
                         most_share=0.25)  # fmt: skip
    with patch.dict(cut._QUALITIES, fast=small):
        tb.unwrap(mesh, quality="fast", size=64, padding=0)


def remesh(drawn):
    mesh = drawn.mesh()
    options = drawn.options(
        tb.RemeshOptions, "surface", "keep_interior", "sharp_edges", "quality",
        resolution=8 + drawn.below(24), close=drawn.pick(("0%", "1%", "10%", "40%", 0.5, 1e30)),
        components=drawn.pick(("all", "largest", 1, 2)),
        n_faces=drawn.pick((None, None, 4, 40)),
    )  # fmt: skip
    require_finite(tb.remesh(mesh, options).positions)
    list(remesh_with_few_tunnels(mesh, 1 + 60 * drawn.below(4), resolution=8 + drawn.below(24)))


def distance(drawn):
    """Distances between two meshes, and from points to one."""
    one, other = drawn.mesh(), drawn.mesh()
    found = tb.surface_distance(one, other, n_samples=1 + drawn.below(64), seed=drawn.below(4))
    assert 0.0 <= found.mean <= found.rms * (1.0 + 1e-9) and found.rms <= found.max * (1.0 + 1e-9)
    itself = tb.surface_distance(one, one, n_samples=9)
    assert itself.max <= 1e-13 * itself.diagonal + 1e-313
    tree = TriangleTree.build(one.positions, one.faces)
    points = drawn.floats(1 + drawn.below(9), 3)
    facing = drawn.floats(len(points), 3) if drawn.flag() else None
    tree.closest_points(points, facing=facing, max_distance=drawn.pick((np.inf, 1.0, 1e-3)))
    if drawn.rarely(32):
        orange(20 + drawn.below(100))


def check(drawn):
    low = drawn.mesh() if drawn.flag() else None
    report = tb.check(drawn.mesh(most=30), low, tb.CheckOptions(size=drawn.pick(SIZES), padding=0))
    for finding in report.findings:
        assert finding.count >= 1 and "nan" not in finding.problem
    if report.has_layout:
        require_finite(report.picture(32))


def atlas(drawn):
    mesh = drawn.mesh(most=24)
    size = drawn.pick((16, 64))
    keep = mesh.uvs is not None and drawn.flag()
    limits = {} if keep else {
        "max_stretch": drawn.pick((None, None, 1.05, 1.5)),
        "seam_angle": drawn.pick((None, None, 10.0, 90.0)),
        "hide_seams": drawn.pick((0.5, 0.0, 1.0)),
    }  # fmt: skip
    options = drawn.options(
        tb.UnwrapOptions, "by_group", *(() if keep else ("seams_at_hard_edges", "straighten")),
        quality=drawn.pick(("fast", "fast", "fast", "good", "good", "best")),
        size=size, padding=drawn.pick((0, 1, 4)), tiles=drawn.pick((1, 1, 1, 3)), keep=keep,
        **limits,
    )  # fmt: skip
    protect = None if keep or drawn.flag() else np.arange(drawn.below(mesh.n_faces + 1))
    mapped = tb.unwrap(mesh, options, protect=protect)
    assert np.array_equal(mapped.positions, mesh.positions)
    if not keep:
        assert not find_overlaps(mapped.corner_uvs()).overlapping.any()
    described(drawn, mapped)


def mappings(drawn):
    """The classical mappings."""
    mesh = drawn.mesh(most=20)
    method = drawn.pick([name for name in METHODS if name != "atlas"])
    given = {"size": drawn.pick((16, 64)), "method": method}
    if "padding" in METHODS[method].options:
        given["padding"] = drawn.pick((0, 1, 4))
    if method == "projector":
        rows = drawn.floats(4, 4).tolist()
        camera = (*drawn.floats(2, extreme=False).tolist(), drawn.pick((None, 1e-3, 1.0, 1e9)))
        given |= {"matrix": rows} if drawn.flag() else {"camera": camera}
    if method == "parametric":
        given["linear"] = tuple(drawn.floats(6).tolist())
    if drawn.flag() and "center" in METHODS[method].options:
        given["center"] = tuple(drawn.floats(3).tolist())
    names = {"axis", "fit", "sides", "caps", "overlap", "surface", "via", "unseen"}
    read = names & set(METHODS[method].options)
    mapped = tb.unwrap(mesh, drawn.options(tb.UnwrapOptions, *sorted(read), **given))
    require_finite(mapped.uvs)
    assert np.array_equal(mapped.positions, mesh.positions)


def layout(drawn):
    """What is said of any texture coordinates: stretch, overlaps and pictures."""
    described(drawn, drawn.mesh(most=20, uvs=True))


def described(drawn, mesh):
    tb.distortion(mesh, drawn.pick(SIZES))
    corners = mesh.corner_uvs()
    find_overlaps(corners)
    overlap_layers(corners, drawn.indices(3, mesh.n_faces), depth=drawn.pick((0.0, 1e-9, 0.1)))
    size, heat = drawn.pick(SIZES), drawn.flag()
    require_finite(tb.draw_layout(mesh, size, heat=heat))
    assert "<svg" in layout_svg(mesh, size, heat=heat)


def rays(drawn):
    """Primary and secondary rays in any direction, from any point."""
    mesh = drawn.mesh(most=40)
    n = 1 + drawn.below(20)
    frame = LocalFrame.around(mesh)
    directions = drawn.floats(n, 3, extreme=False) - drawn.pick((0.0, 0.5))
    sizes = np.linalg.norm(directions, axis=1, keepdims=True)
    directions = np.where(sizes > 0.0, directions / np.where(sizes > 0.0, sizes, 1.0), 0.0)
    origins = 2.0 * drawn.floats(n, 3, extreme=False) - 1.0
    if drawn.flag():
        origins[:] = frame.to_local(mesh.positions[drawn.indices(mesh.n_vertices, n)])
    lengths = drawn.pick((np.full(n, np.inf), np.zeros(n), np.linspace(0.0, 4.0, n)))
    lengths = np.where(directions.any(axis=1), lengths, 0.0)
    chunk = drawn.pick((None, None, 1, 5))
    scene = RayScene.build(mesh, frame, chunk_faces=chunk)
    cells = np.stack(np.divmod(np.arange(n, dtype=np.int32), np.int32(4)), axis=1)
    places = RayPlaces(drawn.indices(2, n).astype(np.int32), cells)
    scene.cast(Rays(origins, directions, lengths, np.zeros(n)), cull_back_faces=drawn.flag(),
               places=drawn.pick((None, places)))  # fmt: skip
    if chunk is None and drawn.flag():
        axes = directions.astype(np.float32)
        ids = drawn.indices(200, n).astype(np.uint32)
        ranges = OcclusionRange(drawn.pick((0.0, 1e-6)), drawn.pick((np.inf, 0.1)), 0.5)
        scene.cast_hemispheres(Hemispheres(origins, axes, axes, ids), direction_sets(4), ranges)


def bake(drawn):
    is_colored = drawn.rarely(4)
    high, low = drawn.mesh(most=30, uvs=is_colored or None), low_poly(drawn)
    if drawn.rarely(3) and not is_colored:
        bumps = drawn.rng().normal(size=low.positions.shape)
        high = uv_sphere(9, 12) if low.name == "uv sphere" else low
        low = low.replace(positions=low.positions + 0.1 * bumps)
    names = CHANNELS if is_colored else MAPS
    maps = tuple(dict.fromkeys(drawn.pick(names) for _ in range(1 + drawn.below(4))))
    samples = drawn.pick((1, 1, 4, 16, "adaptive"))
    given: dict[str, object] = {}
    if samples == "adaptive":
        maps = ("normal",) if drawn.flag() else ("displacement", "normal")
        given["max_error"] = drawn.pick((None, "5deg", "0.01deg"))
    cage = None
    if drawn.rarely(4):
        cage = low.replace(positions=low.positions + 0.1 * drawn.floats(low.n_vertices, 3))
    front = drawn.pick((None, 0.0, 0.5, 1e300)) if cage is None else None
    options = drawn.options(
        tb.BakeOptions, "space", "rays", "orientation", "high_shading", "cull_back_faces", "fill",
        "on_miss", "convention", size=drawn.pick((1, 4, 16, (3, 9))), maps=maps,
        samples=samples, keep_hits=samples != "adaptive" and drawn.flag(),
        padding=drawn.pick((0, 1, 5)),
        front=front, back=drawn.pick((None, 0.1, 0.5, 1e-300)),
        bits=drawn.pick((8, 16, 32)), secondary_rays=4, **given,
    )  # fmt: skip
    with tempfile.TemporaryDirectory() as folder:
        materials = colored(drawn, Path(folder), high) if is_colored else None
        mask = drawn.floats(3, 4, extreme=False) / 4.0 if drawn.rarely(4) else None
        result = tb.bake(high, low, options, cage=cage, materials=materials, skew_mask=mask)
    require_finite(*(baked.values for baked in result.maps.values()))
    if "normal" in result.maps and not is_colored:
        # In world space, what has no data points nowhere.
        require_unit(result.maps["normal"].values, or_zero=options.space != "tangent")
    if result.hits is not None:
        remap_hits(result, tb.BakeOptions(maps=("normal", "displacement")))
    with tempfile.TemporaryDirectory() as folder:
        for name in options.maps:
            result.maps[name].write(Path(folder) / "map.png", bits=drawn.pick((8, 16)))


def low_poly(drawn):
    """Return a mesh with texture coordinates, most of which lie in the unit square."""
    if drawn.rarely(4):
        return drawn.pick((plane(2, 2), uv_sphere(4, 6)))
    mesh = drawn.mesh(uvs=True)
    if drawn.rarely(4):
        return mesh
    n = 3 + drawn.below(9)
    uvs = drawn.floats(n, 2, extreme=False) / 3.0
    return mesh.replace(uvs=uvs, uv_faces=drawn.indices(n, mesh.n_faces, 3))


def colored(drawn, folder, mesh):
    """Return materials with images in a few of their channels."""
    tb.write_image(drawn.rng().random((3, 4, 3)).astype(np.float32), folder / "image.png")
    placing = tuple(map(tuple, drawn.floats(2, 3, extreme=drawn.flag()).tolist()))
    wraps = (drawn.pick(WRAPS), drawn.pick(WRAPS))
    data = (folder / "image.png").read_bytes()
    image = ChannelImage(data, placing=placing, wraps=wraps, is_nearest=drawn.flag())
    channels = {
        "normal": ChannelSource((1.0,), image),
        "base-color": ChannelSource((1.0, 0.5, 0.0), image),
        "roughness": ChannelSource((1.0,), replace(image, components=(1,))),
    }
    materials = (MeshMaterial(name="a", channels=channels), MeshMaterial(name="b"))
    ids = drawn.indices(2, mesh.n_faces)
    return Materials(face_materials=ids, materials=materials)


def cage(drawn):
    found = tb.fit_cage(
        drawn.mesh(most=30), drawn.mesh(), margin=drawn.pick((None, None, 0.0, 0.5))
    )
    require_finite(found.distances)


def streamed(drawn):
    """A bake of a mesh that stays in its file, in chunks."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / drawn.pick(("high.ply", "high.stl"))
        tb.write_mesh(drawn.mesh(most=30, uvs=False, extreme=drawn.rarely(8)), path)
        high = open_streamed(path)
        if high is not None:
            options = tb.BakeOptions(size=drawn.pick((1, 4, 16)), max_memory="1M", padding=0,
                                     maps=("normal", "displacement"))  # fmt: skip
            tb.bake(high, low_poly(drawn), options)


def paint(drawn):
    """Textures from procedures, and from photographs."""
    mesh = low_poly(drawn)
    size = drawn.pick((1, 4, 16))
    if drawn.flag():
        names = ("procedure", "fill", "samples")
        scale = drawn.pick((None, 1e-300, 1e300, (1.0, 2.0, 0.5)))
        bake_solid(mesh, drawn.options(SolidOptions, *names, size=size, scale=scale))
        return
    far = drawn.pick((1.0, 1e-9, 1e9, 1e30))
    position, target = (tuple((far * drawn.floats(3, extreme=False)).tolist()) for _ in range(2))
    up = tuple(drawn.floats(3, extreme=False).tolist())
    image = drawn.image(channels=(1, 3, 4))
    if drawn.flag():
        photo = Photo(image=image, camera=PhotoCamera(position=position, target=target, up=up))
    else:
        uvs = drawn.floats(4, 2)
        mapped = mesh.replace(uvs=uvs, uv_faces=drawn.indices(4, mesh.n_faces, 3))
        photo = Photo(image=image, mapped=mapped)
    bake_photos(mesh, [photo], PhotoOptions(size=size, samples=4))

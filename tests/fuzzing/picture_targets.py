"""Targets of the fuzzer that take or make pictures: lookups, filters, coding, and rendering."""

import atexit
import shutil
import tempfile
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
from random_scenes import random_scene, with_object, write_images

import texbake as tb
from texbake.core import core, portable_math as pm
from texbake.jobs.light_images import squared_errors
from texbake.mesh.topology import surface_side
from texbake.rendering.camera import fill_picture
from texbake.rendering.closeness import structural_similarities, view_errors
from texbake.rendering.resolve import expose
from texbake.rendering.scene.textures import WRAPS
from texbake.texture.cube_map import (
    CubeMap,
    from_latitude_longitude,
    sample_cube,
    shrink_cube,
    to_latitude_longitude,
)
from texbake.texture.encoding import (
    color_ids,
    count_clipped,
    encode_heights,
    encode_normals,
    height_range,
    quantize_points,
    quantize_srgb,
    quantize_unsigned,
    size_at_percentile,
)
from texbake.texture.lookup import lookup, ramp_lookup, volume_lookup
from texbake.texture.mipmaps import mip_chain
from texbake.texture.padding import nearest_owner, push_pull
from texbake.texture.png_files import write_png
from texbake.texture.prefilter import irradiance, specular_levels
from texbake.texture.procedures import evaluate
from texbake.texture.procedures.noise import fractal_sum
from texbake.texture.procedures.options import PROCEDURE_DEFAULTS
from texbake.texture.sample import FILTERS, FILTERS_WITH_FOOTPRINT, sample_texture


def image_lookup(drawn):
    """An image at any coordinates, by each filter."""
    image, n = drawn.image(), 1 + drawn.below(9)
    wrap = drawn.pick(WRAPS)
    kernel = drawn.pick(FILTERS)
    steps = drawn.singles(n, 4) if kernel in FILTERS_WITH_FOOTPRINT else None
    border = np.zeros(image.shape[2]) if wrap == "border" else None
    texture = image
    if kernel in FILTERS_WITH_FOOTPRINT or drawn.flag():
        texture = shrunk(drawn, image)
    sample_texture(texture, drawn.singles(n, 2), steps, filter=kernel, wrap=wrap, border=border,
                      max_anisotropy=drawn.pick((1.0, 16.0)))  # fmt: skip
    lookup(image, drawn.singles(n, 2), wrap=wrap, border=border)
    ramp_lookup(drawn.image()[0], drawn.singles(n))
    volume = drawn.singles(1 + drawn.below(4), 2, 1 + drawn.below(4), 1 + drawn.below(3))
    volume_lookup(volume, drawn.singles(n, 3), wrap=drawn.pick(WRAPS[:3]),
                     filter=drawn.pick(("nearest", "trilinear")))  # fmt: skip


def shrunk(drawn, image):
    kinds = ("color", "data", "normal") if image.shape[2] >= 3 else ("data",)
    return mip_chain(image, kind=drawn.pick(kinds), wrap=drawn.pick(("repeat", "clamp")),
                        filter=drawn.pick(("box", "kaiser")))  # fmt: skip


def padding(drawn):
    image = drawn.image(most=40)
    charts = drawn.indices(4, *image.shape[:2]) - 1
    nearest_owner(charts, drawn.below(12))
    push_pull(image, charts >= 0)


def coding(drawn):
    """Values to codes, their ranges, and the files of codes."""
    image, bits = drawn.image(most=20), drawn.pick((8, 16))
    codes = [quantize_unsigned(image, bits), quantize_srgb(image, bits)]
    rgb = drawn.image(channels=(3,))
    codes += [encode_normals(rgb, bits=bits, convention=drawn.pick(("opengl", "directx")))]
    quantize_points(rgb, np.zeros(3), np.array([1.0, 2.0, 1e-9]), bits)
    heights = drawn.singles(1 + drawn.below(9), 1 + drawn.below(9))
    codes += [encode_heights(heights, bits=bits, mid=0.5, scale=drawn.pick((1.0, 1e-30, 1e30)))]
    covered = drawn.indices(2, *heights.shape).astype(bool)
    mid, scale = height_range(heights, covered, bits=bits, mid=drawn.pick((None, 0.0, 0.3)))
    if scale > 0.0:
        count_clipped(heights, covered, mid=mid, scale=scale)
    size_at_percentile(heights, covered, drawn.pick((0.0, 50.0, 99.0, 100.0)))
    colors = np.zeros((3, 3), drawn.pick((np.uint8, np.uint16)))
    codes += [color_ids(drawn.indices(3, 4, 4).astype(np.float32), colors)]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "codes.png"
        write_png(path, np.atleast_3d(drawn.pick(codes)))
        tb.read_image(path, color=False)
    picture = quantize_unsigned(drawn.image(channels=(3, 4)), 8)
    for other in (picture[::-1], picture.repeat(2, axis=0).repeat(2, axis=1)):
        squared_errors(picture, other, is_cut=picture.shape[2] == 4)


def heights(drawn):
    """Heights to normals and back."""
    image = drawn.image(channels=(1,))
    tb.height_to_normal(image, drawn.options(tb.HeightToNormalOptions, "wrap", "derivative"))
    normals = drawn.image(channels=(3,))
    tb.normal_to_height(normals, drawn.options(tb.NormalToHeightOptions, "method", "wrap"))


def cubes(drawn):
    size = 1 + drawn.below(6)
    cube = CubeMap(drawn.singles(6, size, size, drawn.pick((1, 3, 4))))
    sample_cube(cube, drawn.singles(5, 3), filter=drawn.pick(("nearest", "bilinear")))
    to_latitude_longitude(cube, height=1 + drawn.below(8))
    from_latitude_longitude(drawn.image(), size=1 + drawn.below(8))
    shrink_cube(cube, 1 + drawn.below(size))
    if drawn.rarely(8):
        irradiance(cube, size=1)
    if drawn.rarely(16):
        specular_levels(cube, samples=16)


def procedures(drawn):
    name = drawn.pick(sorted(PROCEDURE_DEFAULTS))
    n, dimensions = 1 + drawn.below(9), drawn.pick((2, 3))
    footprint = drawn.pick((None, drawn.floats(n), drawn.floats(n, dimensions)))
    has_octaves = "octaves" in PROCEDURE_DEFAULTS[name]
    parameters = {"octaves": 1 + drawn.below(32)} if has_octaves else {}
    for key, values in (
        ("weight", ("cubic", "quintic")), ("profile", ("hard", "sine")), ("jitter", (0.0, 1.0)),
        ("interpolation", ("none", "linear", "cubic", "quintic")), ("feature", ("f1", "f2-f1")),
        ("dimensions", (2, 3, None)), ("wrap", ("clamp", "repeat", "mirror")), ("width", (0.1,)),
    ):  # fmt: skip
        if key in PROCEDURE_DEFAULTS[name]:
            parameters[key] = drawn.pick(values)
    points = drawn.floats(n, dimensions)
    evaluate(name, points, footprint, parameters=parameters)
    fractal_sum(points, octaves=1 + drawn.below(8))


@cache
def images():
    """Return a folder of images for scenes, which is there until the process ends."""
    folder = Path(tempfile.mkdtemp())
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    write_images(folder)
    return folder


def scenes(drawn):
    """A scene of any materials and lights, with any mesh in it."""
    scene, options = random_scene(int.from_bytes(drawn.bytes(4), "little"), images())
    mesh = drawn.mesh(extreme=drawn.rarely(4))
    place = drawn.below(len(scene.objects))
    if drawn.flag():
        scene = with_object(scene, place, replace(scene.objects[place], mesh=mesh))
    if drawn.rarely(4):
        lamps = (replace(lamp, intensity=1e6 * lamp.intensity) for lamp in scene.lighting.lights)
        scene = replace(scene, lighting=replace(scene.lighting, lights=tuple(lamps)))
    item = scene.objects[place]
    if drawn.flag() and item.material.normal_map is not None:
        normals = replace(item.material.normal_map, space="object")
        item = replace(item, material=replace(item.material, normal_map=normals))
        scene = with_object(scene, place, item)
    require_sound(tb.render_scene(scene, replace(options, **looks(drawn))))


def require_sound(frame):
    assert np.isfinite(frame.color).all() and frame.color.min() >= 0.0
    assert ((frame.coverage >= 0.0) & (frame.coverage <= 1.0)).all()


def preview(drawn):
    """A mesh alone, from any distance."""
    angles = tuple((360.0 * drawn.floats(2, extreme=False)).tolist())
    view = (*angles, drawn.pick((None, None, 1e-9, 0.5, 1e9)))
    mesh = drawn.mesh(most=30)
    size = {"width": 1 + drawn.below(24), "height": 1 + drawn.below(16)}
    options = tb.RenderOptions(view=view, **size, **looks(drawn))
    frame = tb.render(mesh, options=options)
    require_sound(frame)
    if options.max_error is None and options.buffer is None and options.mapping_order == "screen":
        assert frame.face_ids.max() < mesh.n_faces
    expose([frame], options)
    surface_side(mesh)
    fill_picture([mesh], options)
    closeness(drawn, mesh, frame)


def closeness(drawn, mesh, frame):
    """A picture beside itself, and the sides of a face that an eye anywhere sees."""
    view_errors(frame, frame, float(drawn.floats(1)[0]))
    window = min(7, *(side - 1 + side % 2 for side in frame.coverage.shape))
    if window >= 3:
        color = np.ascontiguousarray(frame.color[..., :3], np.float32)
        structural_similarities(color, color[::-1].copy(), window)
    face = np.array([drawn.below(mesh.n_faces)], np.int32)
    core.measure_facing(mesh.positions, mesh.faces, face, drawn.floats(3), np.empty(1))


def numbers(drawn):
    """Elementary functions and small matrices, with any numbers."""
    n = 1 + drawn.below(4)
    x, y = drawn.floats(n, n), drawn.floats(n, n)
    for function in (pm.sin, pm.cos, pm.tan, pm.arcsin, pm.arccos, pm.arctan, pm.exp, pm.log):
        function(x)
    for function in (pm.log2, pm.log10):
        function(x)
    for function in (pm.arctan2, pm.hypot, pm.power):
        function(x, y)
    with np.errstate(all="ignore"):
        pm.power(x.astype(np.float32), y.astype(np.float32))
        pm.matmul(x, y)
        pm.vecdot(x, y)
        pm.det(x)
        pm.eigh(x + x.T)
        pm.svd(x)


def looks(drawn):
    """Options of a picture that change how it is drawn."""
    buffers = (None, None, None, "depth", "normals", "mip-level", "overdraw", "object-id")
    chosen: dict[str, object] = {
        "back_faces": drawn.pick(("cull", "show")),
        "edges": drawn.pick(("multisample", "supersample")),
        "supersampling": drawn.pick((1, 2, 3)),
    }
    kind = drawn.below(6)
    if kind == 0:
        chosen["interpolation"] = drawn.pick(("affine", "scanline"))
    if kind == 1:
        chosen["max_error"] = drawn.pick((0.3, 0.02))
    if kind == 2:
        chosen["buffer"] = drawn.pick(buffers)
    if kind == 3:
        chosen |= {"mapping_order": drawn.pick(("texture", "texture-coverage")), "supersampling": 1}
    return chosen

"""Pictures: samples, effects that nothing needs, and other renderers.

python tests/benchmarks/bench_rendering.py samples | effects | llvmpipe | renderers
"""

from __future__ import annotations

import os
import tempfile
import time
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
import peer_scenes
from harness import SCENES, in_turn, run_commands, table
from peer_job import Job

import texbake
from texbake.mesh.mesh import Mesh
from texbake.mesh.normals import shading_normals
from texbake.mesh.shapes import grid_sphere, uv_sphere
from texbake.mesh.tangents import corner_tangents
from texbake.mesh.weld import weld_rows
from texbake.rendering.camera import Camera
from texbake.rendering.draw import draw, plan_of, prepare
from texbake.rendering.effects import EFFECTS
from texbake.rendering.options import RenderOptions
from texbake.rendering.scene.lights import Ambient, Light, Lighting
from texbake.rendering.scene.material import Material, NormalMap
from texbake.rendering.scene.scene import Scene, SceneObject, camera_of
from texbake.rendering.scene.textures import ImageTexture
from texbake.texture.encoding import decode_srgb, encode_srgb

NAMES = ("orange_bump", "shadow_spot", "reflection", "transparency", "normal_map", "checker")
BOUNDS = ("16/255", "8/255", "4/255", "2/255", "1/255")
FIXED = [(side, edges) for edges in ("multisample", "supersample") for side in (1, 2, 4, 8, 16)]
TRUTH = (13, 15)
FIGURES = ("rms", "99 %", "99.9 %", "greatest")


def samples(*scenes, rounds=2, width=480):
    """Error against time of pictures with fixed and adaptive samples, on scenes of the samples.

    The error is the greatest difference in any channel of the sRGB-coded picture, in steps of 255,
    over the pixels that show a surface, from 13 x 13 plus 15 x 15 shaded samples per pixel. No
    setting has any of these samples but the middle one. Times are processor seconds of one thread,
    the least of the rounds, with the check of 1 % of the pixels. The second table has, for each
    bound, the cheapest fixed setting that is not worse, as a multiple of the adaptive picture's
    time.
    """
    from texbake.jobs.preview_scene import with_lighting
    from texbake.rendering.scene.read import read_scene

    for name in scenes or NAMES:
        scene = with_lighting(read_scene(SCENES / f"{name}.toml"))
        own = scene.options(interpolation="perspective", buffer=None)
        options = replace(own, width=width, height=max(1, width * own.height // own.width))
        truth, shows = converged(scene, options)
        settings = {
            f"{side} x {side} {edges}": replace(options, supersampling=side, edges=edges)
            for side, edges in FIXED
        }
        settings |= {bound: replace(options, max_error=bound) for bound in BOUNDS}
        runs = in_turn(
            {
                key: partial(texbake.render_scene, scene, more, threads=1)
                for key, more in settings.items()
            },
            rounds,
        )
        print(f"\n{name}\n")
        row = table("setting", "seconds", "shadings", *FIGURES)
        errors, least = {}, {key: min(found.seconds) for key, found in runs.items()}
        for key, found in runs.items():
            frame = found.result
            off = np.abs(encode_srgb(frame.color[..., :3]) - encode_srgb(truth)).max(axis=-1)[shows]
            errors[key] = 255 * np.array(
                [np.sqrt((off**2).mean()), *np.percentile(off, [99, 99.9, 100])]
            )
            shadings = frame.sampling.shadings_per_pixel if frame.sampling else np.nan
            row(key, f"{least[key]:.2f}", f"{shadings:.2f}", *(f"{x:.3g}" for x in errors[key]))
        print()
        row = table("bound", *FIGURES)
        for bound in BOUNDS:
            cells = []
            for i in range(len(FIGURES)):
                equal = [k for k in runs if k not in BOUNDS and errors[k][i] <= errors[bound][i]]
                best = min(equal, key=least.get, default=None)
                cells.append(
                    "not reached" if best is None else f"{least[best] / least[bound]:.2f} ({best})"
                )
            row(bound, *cells)


def converged(scene, options):
    """Light (H, W, 3) of 394 samples per pixel, and which pixels show a surface."""
    from texbake.progress import Stages
    from texbake.rendering.adaptive_pixels.pixel_statistics import PixelSums, Sides
    from texbake.rendering.adaptive_pixels.sampler import PixelSampler
    from texbake.rendering.draw import lay_out
    from texbake.rendering.request import RenderRequest

    asked = replace(options, max_error=0.5)
    request = RenderRequest(scene, asked, camera_of(scene, asked))
    state = lay_out(prepare(scene, asked), request, Stages(), all_objects=True)
    grids = [PixelSums.empty(options.height, options.width) for _ in TRUTH]
    for sums, side in zip(grids, TRUTH, strict=True):
        PixelSampler(state).take(np.ones(sums.counts.shape, bool), Sides(side, side), sums)
    light = sum(sums.light[..., :3] for sums in grids) / sum(side**2 for side in TRUTH)
    return light, grids[-1].coverage > 0.0


def effects(runs=41, threads=1, size=(640, 360)):
    """What an effect costs a scene that nothing in calls for it.

    An unlit sphere of one color is drawn with all effects, and with a list that lacks one that it
    does not call for, or all of those. The ratio is 1.00 where it costs nothing; the spread is that
    of the shorter list against itself.
    """
    options = RenderOptions(width=size[0], height=size[1])
    material = Material(shading="unlit", base_color=(0.8, 0.4, 0.2))
    scene = Scene(objects=(SceneObject(mesh=uv_sphere(64, 128), material=material),))
    camera = Camera.framing(scene.objects[0].mesh, options=options)
    used = {item.name for item in plan_of(prepare(scene, options), camera).passes}
    lists = {
        effect.name: [other for other in EFFECTS if other is not effect]
        for effect in EFFECTS
        if effect.name not in used
    }
    needed = [effect for effect in EFFECTS if effect.name in used]
    lists[f"all but {', '.join(effect.name for effect in needed)}"] = needed
    row = table("without", "ms", "with all / without", "spread")
    full = prepare(scene, options, threads=threads)
    for name, fewer in lists.items():
        bare = prepare(scene, options, effects=fewer, threads=threads)
        found = in_turn({key: partial(draw, key, camera) for key in (full, bare)}, runs)
        row(name, found[bare].cell(unit=1e-3), found[full].times(found[bare], 3),
            found[bare].spread())  # fmt: skip


TO_LIGHT, AMBIENT = (0.6, 0.64, 0.48), (0.1, 0.1, 0.1)
SIZE = 2048  # texels of a side


def llvmpipe(runs=9, threads=0, samples=(1, 4)):
    """What a picture costs, beside OpenGL on Mesa's llvmpipe.

    Two scenes with one directional light: a sphere of 3,996,000 triangles at 1280 x 720, and one of
    5,040 triangles at 1920 x 1080 with a texture and a normal map of 2048 x 2048, trilinear. Each
    is drawn with one sample per pixel and with four, where a pixel inside a triangle is shaded once
    (texbake's `multisample`, OpenGL's MSAA). "Frame" is one picture of prepared data (buffers, mip
    levels, shaders), read back; "whole" starts from arrays in memory, including normals and
    tangents. llvmpipe gives 8-bit codes, which costs it least; texbake gives linear float32. The
    rate is how many pictures texbake draws while llvmpipe draws one. Needs what `peer_llvmpipe`
    needs.
    """
    from peer_job import UnavailableError
    from peer_llvmpipe import Llvmpipe

    try:
        peer = Llvmpipe(threads or None, codes=True)
    except UnavailableError as error:
        raise SystemExit(str(error)) from error
    print(f"{peer.name}\n")
    row = table("scene", "samples", "what", "texbake, ms", "llvmpipe, ms", "rate")
    for case in many_triangles(), with_maps():
        for n in samples:
            functions = contenders(case, n, peer, threads or None)
            found = in_turn(functions, runs, time.perf_counter)
            for what in "frame", "whole":
                ours, theirs = found[what, "texbake"], found[what, "llvmpipe"]
                row(case.name, n, what, ours.cell(0, unit=1e-3), theirs.cell(0, unit=1e-3),
                    theirs.times(ours))  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Case:
    """A mesh with its normals, maybe with images; 8-bit codes, as files hold them."""

    name: str
    mesh: Mesh
    width: int
    height: int
    base_map: np.ndarray | None = None
    normal_map: np.ndarray | None = None


def with_normals(mesh):
    normals, normal_faces = shading_normals(mesh)
    return mesh.replace(normals=normals, normal_faces=normal_faces)


def many_triangles():
    def radius(theta, phi):
        return 1 + 0.02 * np.sin(40 * theta) * np.sin(40 * phi)

    mesh = with_normals(grid_sphere(1000, 2000, radius))
    return Case(name="4 M triangles", mesh=mesh, width=1280, height=720)


def with_maps():
    mesh = with_normals(uv_sphere(36, 72))
    mesh = mesh.replace(tangents=corner_tangents(mesh))
    y, x = np.mgrid[:SIZE, :SIZE] * (2 * np.pi / SIZE)
    noise = np.random.default_rng(0).integers(-30, 31, (SIZE, SIZE, 3))
    waves = np.stack([np.sin(8 * x), np.sin(9 * y), np.sin(5 * (x + y))], axis=-1)
    normals = np.stack([0.4 * np.sin(40 * x), 0.4 * np.sin(40 * y), np.ones_like(x)], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    return Case(
        name="5 k triangles, texture, normal map", mesh=mesh, width=1920, height=1080,
        base_map=(128 + 90 * waves + noise).clip(0, 255).astype(np.uint8),
        normal_map=np.rint(127.5 + 127.5 * normals).astype(np.uint8),
    )  # fmt: skip


def vertex_stream(mesh):
    """Vertices that carry all attributes at one index, as many as it takes."""
    if mesh.uvs is None and np.array_equal(mesh.normal_faces, mesh.faces):
        return {"positions": mesh.positions, "normals": mesh.normals, "faces": mesh.faces}
    columns = [mesh.positions[mesh.faces], mesh.normals[mesh.normal_faces]]
    columns += [mesh.uvs[mesh.uv_faces], mesh.tangents.astype(np.float64)]
    corners = np.concatenate(columns, axis=-1).reshape(3 * mesh.n_faces, -1)
    firsts, faces = np.unique(weld_rows(corners), return_inverse=True)
    parts = np.split(corners[firsts], [3, 6, 8], axis=1)
    names = "positions", "normals", "uvs", "tangents"
    return dict(zip(names, parts, strict=True)) | {"faces": faces.reshape(-1, 3)}


def contenders(case, samples, peer, threads):
    """(what, who) to a function that draws one picture."""
    options = RenderOptions(
        width=case.width, height=case.height, supersampling={1: 1, 4: 2}[samples], background=None
    )
    camera = Camera.framing(case.mesh, options=options)
    job = Job(
        **vertex_stream(case.mesh), eye=camera.eye,
        clip_from_world=camera.clip_from_world(case.width / case.height),
        axes=camera.axes, width=case.width, height=case.height, shading="lambert",
        base_map=case.base_map, normal_map=case.normal_map, to_light=TO_LIGHT, ambient=AMBIENT,
        samples=samples,
    )  # fmt: skip
    base_color, normal_map = (1.0, 1.0, 1.0), None
    if case.base_map is not None:
        linear = decode_srgb(case.base_map / 255.0).astype(np.float32)
        base_color = ImageTexture(image=linear, wrap="repeat")
        vectors = (case.normal_map / 127.5 - 1.0).astype(np.float32)
        normal_map = NormalMap(texture=ImageTexture(image=vectors, wrap="repeat"))
    material = Material(shading="lambert", base_color=base_color, normal_map=normal_map)
    light = Light(direction=tuple(-x for x in TO_LIGHT))
    scene = Scene(
        objects=(SceneObject(mesh=case.mesh, material=material),),
        lighting=Lighting(lights=(light,), ambient=Ambient(color=AMBIENT)),
    )
    prepared, loaded = prepare(scene, options, threads=threads), peer.load(job)

    def whole_of_peer():
        fresh = peer.load(job)
        peer.draw(fresh)
        fresh.release()

    return {
        ("frame", "texbake"): lambda: draw(prepared, camera),
        ("frame", "llvmpipe"): lambda: peer.draw(loaded),
        ("whole", "texbake"): lambda: draw(prepare(scene, options, threads=threads), camera),
        ("whole", "llvmpipe"): whole_of_peer,
    }


def renderers(*names, models=None, sheet=None, plain=False):
    """The samples' scenes as other renderers draw them, and how alike the pictures are.

    Every scene of samples/scenes that glTF can hold, and every .glb file of the folder `--models`,
    is drawn by texbake, by three.js in Chromium (see `peer_threejs`), and, where
    TEXBAKE_BLENDER_PYTHON names a Python with bpy 5.0.1, by Blender's Cycles and EEVEE. Cells are
    the PSNR in dB of the sRGB codes inside the outlines, and the share of pixels that only one
    program covers. `--sheet` also writes a row of pictures for each scene to a folder; `--plain`
    leaves out of three.js what it adds to glTF's formula: light that bounces between microfacets,
    and roughness where normals change from pixel to pixel.
    """
    from texbake.texture.image import write_image

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        cases, refused = peer_scenes.collected(names, models and Path(models), folder)
        drawn = {"three.js": peer_scenes.by_threejs(cases, folder, plain=plain)}
        if os.environ.get("TEXBAKE_BLENDER_PYTHON"):
            drawn["Cycles"] = peer_scenes.by_blender(cases, folder, "CYCLES")
            drawn["EEVEE"] = peer_scenes.by_blender(cases, folder, "BLENDER_EEVEE")
        row = table("scene", *drawn)
        for k, case in enumerate(cases):
            cells, shown = [], [case.ours(4)]
            for peer, pictures in drawn.items():
                if pictures[k] is None:
                    cells.append("–")
                    continue
                ours = case.ours(1) if peer == "three.js" else shown[0]
                psnr, outline = peer_scenes.alike(ours, pictures[k])
                cells.append(f"{psnr:.1f} dB, {outline:.2f} %")
                shown.append(pictures[k])
            row(case.name, *cells)
            if sheet is not None:
                Path(sheet).mkdir(exist_ok=True)
                strip = np.concatenate([np.clip(p[..., :3], 0, 1) for p in shown], axis=1)
                write_image(strip.astype(np.float32), f"{sheet}/{case.name}.png", color=True)
    for reason in sorted(set(refused.values())):
        left_out = ", ".join(scene for scene, why in refused.items() if why == reason)
        print(f"not drawn elsewhere, {reason}: {left_out}")


if __name__ == "__main__":
    run_commands(globals(), samples, effects, llvmpipe, renderers)

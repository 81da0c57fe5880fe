"""What a picture costs, beside OpenGL on Mesa's llvmpipe in the same run.

    python tests/benchmarks/bench_render.py [--runs 9] [--threads 2]

Two scenes with one directional light: a sphere of 3,996,000 triangles at 1280 x 720, and one of
5,040 triangles at 1920 x 1080 with a texture and a normal map of 2048 x 2048, trilinear. Each is
drawn with one sample per pixel and with four, where a pixel inside a triangle is shaded once
(texbake's `multisample`, OpenGL's MSAA). "Frame" is one picture of prepared data (buffers, mip
levels, shaders), read back; "whole" starts from arrays in memory, including normals and tangents.
llvmpipe gives 8-bit codes, which costs it least; texbake gives linear float32. Both take turns
after a first round that does not count. Prints a table in Markdown: medians with minimum and
maximum, and how many pictures texbake draws while llvmpipe draws one.

Needs what `peer_llvmpipe` needs.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from peer_job import Job, UnavailableError
from peer_llvmpipe import Llvmpipe

from texbake.mesh.mesh import Mesh
from texbake.mesh.normals import shading_normals
from texbake.mesh.shapes import grid_sphere, uv_sphere
from texbake.mesh.tangents import corner_tangents
from texbake.mesh.weld import weld_rows
from texbake.rendering.camera import Camera
from texbake.rendering.draw import draw, prepare
from texbake.rendering.options import RenderOptions
from texbake.rendering.scene.lights import Ambient, Light, Lighting
from texbake.rendering.scene.material import Material, NormalMap
from texbake.rendering.scene.scene import Scene, SceneObject
from texbake.rendering.scene.textures import ImageTexture
from texbake.texture.encoding import decode_srgb

TO_LIGHT = (0.6, 0.64, 0.48)
AMBIENT = (0.1, 0.1, 0.1)
SIZE = 2048  # texels a side


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


def mapped():
    mesh = with_normals(uv_sphere(36, 72))
    mesh = mesh.replace(tangents=corner_tangents(mesh))
    y, x = np.mgrid[:SIZE, :SIZE] * (2 * np.pi / SIZE)
    noise = np.random.default_rng(0).integers(-30, 31, (SIZE, SIZE, 3))
    waves = np.stack([np.sin(8 * x), np.sin(9 * y), np.sin(5 * (x + y))], axis=-1)
    normals = np.stack([0.4 * np.sin(40 * x), 0.4 * np.sin(40 * y), np.ones_like(x)], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    return Case(
        name="5 k triangles, texture, normal map",
        mesh=mesh,
        width=1920,
        height=1080,
        base_map=(128 + 90 * waves + noise).clip(0, 255).astype(np.uint8),
        normal_map=np.rint(127.5 + 127.5 * normals).astype(np.uint8),
    )


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


def job_of(case, camera, samples):
    return Job(
        **vertex_stream(case.mesh),
        clip_from_world=camera.clip_from_world(case.width / case.height),
        eye=camera.eye,
        axes=camera.axes,
        width=case.width,
        height=case.height,
        shading="lambert",
        base_map=case.base_map,
        normal_map=case.normal_map,
        to_light=TO_LIGHT,
        ambient=AMBIENT,
        samples=samples,
    )


def scene_of(case):
    base_color, normal_map = (1.0, 1.0, 1.0), None
    if case.base_map is not None:
        linear = decode_srgb(case.base_map / 255.0).astype(np.float32)
        base_color = ImageTexture(image=linear, wrap="repeat")
    if case.normal_map is not None:
        vectors = (case.normal_map / 127.5 - 1.0).astype(np.float32)
        normal_map = NormalMap(texture=ImageTexture(image=vectors, wrap="repeat"))
    material = Material(shading="lambert", base_color=base_color, normal_map=normal_map)
    direction = -TO_LIGHT[0], -TO_LIGHT[1], -TO_LIGHT[2]
    return Scene(
        objects=(SceneObject(mesh=case.mesh, material=material),),
        lighting=Lighting(lights=(Light(direction=direction),), ambient=Ambient(color=AMBIENT)),
    )


def contenders(case, samples, peer, threads):
    """(what, who) to a function that draws one picture."""
    options = RenderOptions(
        width=case.width, height=case.height, supersampling={1: 1, 4: 2}[samples], background=None
    )
    camera = Camera.framing(case.mesh, options=options)
    scene, job = scene_of(case), job_of(case, camera, samples)
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


def measure(functions: dict[tuple[str, str], Callable[[], object]], runs: int):
    """Milliseconds of each function, called in turn, the first round left out."""
    times = {key: [] for key in functions}
    for _ in range(runs + 1):
        for key, function in functions.items():
            start = time.perf_counter()
            function()
            times[key].append(1e3 * (time.perf_counter() - start))
    return {key: values[1:] for key, values in times.items()}


def cell(values):
    return f"{statistics.median(values):.0f} ({min(values):.0f} to {max(values):.0f})"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=9)
    parser.add_argument("--threads", type=int, default=None)
    parser.add_argument("--samples", type=int, nargs="*", default=[1, 4], choices=[1, 4])
    arguments = parser.parse_args()
    try:
        peer = Llvmpipe(arguments.threads, codes=True)
    except UnavailableError as error:
        print(error, file=sys.stderr)
        return 1
    print(f"{peer.name}\n\n| scene | samples | what | texbake, ms | llvmpipe, ms | rate |")
    print("|" + "---|" * 6)
    for case in many_triangles(), mapped():
        for samples in arguments.samples:
            functions = contenders(case, samples, peer, arguments.threads)
            times = measure(functions, arguments.runs)
            for what in "frame", "whole":
                ours, theirs = times[what, "texbake"], times[what, "llvmpipe"]
                rate = statistics.median(theirs) / statistics.median(ours)
                print(
                    f"| {case.name} | {samples} | {what} | {cell(ours)} | {cell(theirs)} "
                    f"| {rate:.2f} |",
                    flush=True,
                )
    return 0


if __name__ == "__main__":
    sys.exit(main())

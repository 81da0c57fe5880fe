"""`texbake lighten`: its time on a made model, and bytes and pictures of real ones.

    python tests/benchmarks/bench_lighten.py OUT [MODEL ...] [--faces N] [--size PX]

Without MODEL, a bumpy sphere of 102,080 triangles with five images of 2048² is made in the folder
OUT and lightened five times; the median of each stage is printed, with the least and the greatest.
With models, each is lightened once, with a tenth of its triangles unless `--faces` is given, and
its row in Markdown has the bytes and the PSNR before and after.
"""

from __future__ import annotations

import argparse
import statistics
from pathlib import Path

import numpy as np

import texbake
from texbake.jobs.options import LightenOptions
from texbake.texture.image import write_image
from texbake.verbs.lighten import lighten_file

SIZE = 2048
RUNS = 5
MAPS = {"map_Kd": "color", "map_Ke": "glow", "map_Pr": "rough", "map_Pm": "metal", "norm": "bumps"}


def smooth_noise(seed, channels, octaves=6):
    """(SIZE, SIZE, channels) float32 in [0, 1] that repeats at the borders."""
    numbers = np.random.default_rng(seed)
    total = np.zeros((SIZE, SIZE, channels), np.float32)
    for octave in range(1, octaves + 1):
        grid = numbers.random((2 ** (octave + 2), 2 ** (octave + 2), channels), dtype=np.float32)
        times = SIZE // len(grid)
        total += np.repeat(np.repeat(grid, times, 0), times, 1) / 2**octave
    return np.clip(total, 0, 1)


def normals_of(heights):
    """A normal map, coded in [0, 1], of heights that repeat."""
    slopes = [
        2 * (np.roll(heights, -1, axis) - np.roll(heights, 1, axis))[..., 0] for axis in (1, 0)
    ]
    normals = np.stack([-slopes[0], slopes[1], np.ones_like(slopes[0])], axis=2)
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    return (0.5 + 0.5 * normals).astype(np.float32)


def made_model(folder):
    """Write model.obj with its material and images, unless it is there."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "model.obj"
    if path.exists():
        return path
    sphere = texbake.make("sphere", texbake.MakeOptions(resolution=(320, 160)))
    directions = sphere.positions / np.linalg.norm(sphere.positions, axis=1, keepdims=True)
    bumps = 0.02 * np.sin(directions * [[23, 17, 29]]).sum(axis=1)
    mesh = sphere.replace(
        positions=directions * (1 + bumps)[:, None], normals=None, normal_faces=None
    )
    texbake.write_mesh(mesh, path)
    images = {name: smooth_noise(seed, 3) for seed, name in enumerate(MAPS.values())}
    images["bumps"] = normals_of(smooth_noise(9, 1))
    for name in ("rough", "metal"):
        images[name] = images[name][..., :1]
    for name, pixels in images.items():
        write_image(pixels, folder / f"{name}.png", bits=8)
    lines = ["newmtl all", "Kd 1 1 1", *(f"{key} {name}.png" for key, name in MAPS.items())]
    (folder / "model.mtl").write_text("\n".join(lines) + "\n")
    path.write_text("mtllib model.mtl\nusemtl all\n" + path.read_text())
    return path


def measure_time(folder):
    model = made_model(folder)
    reports = [
        lighten_file(model, folder / "light.glb", LightenOptions(size=SIZE)).report
        for _ in range(RUNS)
    ]
    print("| stage | median | least | greatest |\n|---|---|---|---|")
    names = [stage.name for stage in reports[0].stages]
    rows = {n: [s.seconds for r in reports for s in r.stages if s.name == n] for n in names}
    rows["total"] = [sum(s.seconds for s in r.stages) for r in reports]
    for name, times in rows.items():
        middle = statistics.median(times)
        print(f"| {name} | {middle:.2f} s | {min(times):.2f} s | {max(times):.2f} s |")


def measure_models(folder, models, faces, size):
    folder.mkdir(parents=True, exist_ok=True)
    print(
        "| model | triangles | lightened | texels | bytes | lightened | | PSNR, mean | worst |\n"
        "|---|---|---|---|---|---|---|---|---|"
    )
    for model in models:
        chosen = LightenOptions(n_faces=faces, size=size, compress=True)
        report = lighten_file(model, folder / f"{Path(model).stem}.glb", chosen).report
        share = report.n_bytes / report.n_bytes_before
        print(
            f"| {Path(model).stem} | {report.n_faces_before:,} | {report.n_faces:,} "
            f"| {'-' if report.size is None else report.size[0]} "
            f"| {report.n_bytes_before:,} | {report.n_bytes:,} | {100 * share:.1f} % "
            f"| {report.comparison.mean_db:.1f} dB | {report.comparison.worst_db:.1f} dB |",
            flush=True,
        )


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", type=Path)
    parser.add_argument("models", nargs="*", type=Path)
    parser.add_argument("--faces", type=int)
    parser.add_argument("--size", type=int)
    arguments = parser.parse_args()
    if arguments.models:
        measure_models(arguments.out, arguments.models, arguments.faces, arguments.size)
    else:
        measure_time(arguments.out)


if __name__ == "__main__":
    main()

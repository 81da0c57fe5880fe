"""Bakes of real pairs: misses, the difference from Blender, and how close the result comes.

    python tests/benchmarks/bench_real_pairs.py [--picture OUT.png]

The meshes and Blender's maps are those of TEXBAKE_DATA, or of ../shared/data beside the project.
Prints a table in Markdown; `--picture` draws all pairs, one below the other.
"""

from __future__ import annotations

import argparse
import os
import time
from pathlib import Path

import numpy as np

import texbake
from texbake.texture.encoding import decode_normals

DATA = Path(os.environ.get("TEXBAKE_DATA", Path(__file__).parents[3] / "shared" / "data"))
# Ray distance of Blender's answer.
PAIRS = {"koala": 0.2258574, "skull": 0.4077253, "spot": 0.0532155, "penguin": 0.0740113}
SIZE = 1024
WIDTH = 1600  # pixels of the picture


def degrees_to_blender(name, high, low, distance):
    """Mean and median angle to Blender's map with its own ray directions and distances."""
    options = texbake.BakeOptions(
        size=SIZE, rays="vertex", front=distance, back=distance, padding=0
    )
    result = texbake.bake(high, low, options)
    pixels = texbake.read_image(DATA / "blender" / f"{name}_normal_{SIZE}.png", color=False).pixels
    both = result.has_data & (np.abs(pixels - [0.5, 0.5, 1]).max(axis=2) > 1e-4)
    chords = np.linalg.norm(result.maps["normal"].values - decode_normals(pixels), axis=2)[both]
    degrees = np.degrees(2 * np.arcsin(np.minimum(chords / 2, 1)))
    return degrees.mean(), np.median(degrees), 100 * (degrees > 5).mean()


def measure(name, distance):
    """One row of the table, and the pictures side by side."""
    folder = DATA / "pairs" / name
    high, low = texbake.read_mesh(folder / "high.obj"), texbake.read_mesh(folder / "low_uv.obj")
    mean, median, different = degrees_to_blender(name, high, low, distance)
    start = time.perf_counter()
    result = texbake.bake(high, low, texbake.BakeOptions(size=SIZE, samples=4))
    seconds = time.perf_counter() - start
    picture = texbake.RenderOptions(width=640, height=480, view=(30.0, 15.0))
    comparison = texbake.compare(
        high, low, normal_map=result.maps["normal"].values, options=picture
    )
    bare, mapped = comparison.bare, comparison.mapped
    row = (
        f"| {name} | {high.n_faces:,} | {low.n_faces:,} | {result.report.miss_percent:.3f} % "
        f"| {mean:.3f}° / {median:.4f}° | {different:.2f} % | {bare.mean_deg:.2f}° "
        f"| {mapped.mean_deg:.2f}° | {bare.psnr_db:.1f} | {mapped.psnr_db:.1f} | {seconds:.2f} s |"
    )
    return row, comparison.side_by_side()


def narrowed(picture):
    """The picture at the common width, by area."""
    from skimage.transform import resize

    height = round(picture.shape[0] * WIDTH / picture.shape[1])
    return resize(picture, (height, WIDTH), anti_aliasing=True).astype(np.float32)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--picture", type=Path)
    arguments = parser.parse_args()
    print(
        "| pair | high-poly | low-poly | missed | to Blender, mean / median | over 5° "
        "| bare | baked | PSNR bare | PSNR baked | bake |"
    )
    print("|---|---|---|---|---|---|---|---|---|---|---|")
    pictures = []
    for name, distance in PAIRS.items():
        row, picture = measure(name, distance)
        print(row)
        pictures.append(narrowed(picture))
    if arguments.picture is not None:
        texbake.write_image(np.concatenate(pictures), arguments.picture, color=True, bits=8)


if __name__ == "__main__":
    main()

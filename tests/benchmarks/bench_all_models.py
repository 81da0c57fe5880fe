"""`texbake run` on every model of the data folder: figures of each asset, and a sheet of all.

    python tests/benchmarks/bench_all_models.py OUT [NAME ...] [--faces N] [--picture SHEET.jpg]

The models are those of TEXBAKE_DATA, or of ../shared/data beside the project: single meshes,
dense meshes of pairs, broken meshes and glTF models. Each gets N triangles, or a tenth of its own,
500 at least and 5,000 at most, and maps of 1024². Assets stay in the folder OUT; a model whose
asset is there already is not made again. Prints a table in Markdown; `--picture` draws a sheet with
each model beside its asset.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont, ImageOps

import texbake
from texbake.errors import TexbakeError
from texbake.rendering.compare_models import compare_models

DATA = Path(os.environ.get("TEXBAKE_DATA", Path(__file__).parents[3] / "shared" / "data"))
PATTERNS = ("meshes/*", "pairs/*/high.obj", "pairs/*/LeePerrySmith.obj", "broken/*", "gltf/*.glb")
MESHES = (".obj", ".ply", ".stl", ".glb", ".gltf")
COLUMNS = 5
TILE = (210, 168)  # pixels of one of the two pictures
LINE = 16  # pixels of a line of text
MODEL, ASSET = 0, 2  # panels of the preview that the sheet shows
BACKGROUND = (24, 26, 30)


def models(names: list[str]) -> list[Path]:
    found = [path for pattern in PATTERNS for path in sorted(DATA.glob(pattern))]
    found += sorted(DATA.glob("gltf/*/*.gltf"))
    found = [path for path in found if path.suffix.lower() in MESHES]
    return [path for path in found if not names or any(name in str(path) for name in names)]


def name_of(path: Path) -> str:
    return path.parent.name if path.stem == "high" else path.stem


def make_asset(path: Path, folder: Path, n_faces: int | None) -> dict:
    """Run the command, and keep its exit status, time and what it printed."""
    record = folder / "record.json"
    if record.exists():
        return json.loads(record.read_text())
    try:
        triangles = texbake.read_mesh(path).n_faces
    except TexbakeError:
        triangles = 0
    faces = n_faces or min(max(triangles // 10, 500), 5000)
    command = [sys.executable, "-m", "texbake", "run", str(path), "-o", str(folder)]
    command += ["--faces", str(faces), "--size", "1024", "--compare", "full"]
    command += ["--progress", "none"]
    start = time.perf_counter()
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    entry = {
        "name": name_of(path),
        "triangles": triangles,
        "status": ended.returncode,
        "seconds": time.perf_counter() - start,
        "says": ended.stderr.strip(),
    }
    folder.mkdir(parents=True, exist_ok=True)
    for report in folder.glob("*_report.json"):
        made = json.loads(report.read_text())
        entry |= {"faces": made["simplify"]["n_faces"], "compare": made["compare"]}
    record.write_text(json.dumps(entry))
    return entry


def decibels(figures: dict) -> str:
    """PSNR, which reports leave out where both pictures are the same."""
    return "equal" if figures["psnr_db"] is None else f"{figures['psnr_db']:.1f} dB"


def row(entry: dict) -> str:
    if "compare" not in entry:
        return f"| {entry['name']} | {entry['triangles']:,} | {entry['says']} |"
    compared = entry["compare"]

    def cell(key: str) -> str:
        if key not in compared:
            return "-"
        figures = compared[key]
        return (
            f"{decibels(figures)}, {figures['mean_deg']:.1f}°, "
            f"{100 * figures['outline_mismatch']:.1f} % + {100 * figures['depth_mismatch']:.1f} %"
        )

    warnings = entry["says"].count("warning")
    return (
        f"| {entry['name']} | {entry['triangles']:,} | {entry['faces']:,} | {cell('bare')} "
        f"| {cell('mapped')} | {cell('displaced')} | {warnings} | {entry['seconds']:.0f} s |"
    )


def panel(picture: Image.Image, index: int) -> Image.Image:
    """One of the four panels of a file of pictures, without its caption."""
    width = picture.width // 4
    strip = picture.crop((index * width, 0, (index + 1) * width, picture.height))
    # The page shows at the rim of the strip, and again where the caption begins.
    middle = np.asarray(strip)[:, width // 2]
    inside = (middle != middle[0]).any(axis=1)
    top = int(inside.argmax())
    below = np.flatnonzero(~inside[top:])
    bottom = top + int(below[0]) if len(below) else strip.height
    return strip.crop((0, top, width, bottom))


def pictures_of(path: Path, folder: Path) -> list[Image.Image]:
    """The model and its asset: with their materials if it has images, else as run drew them."""
    mesh = texbake.read_mesh(path)
    materials = texbake.read_materials(path, mesh)
    if materials is not None and materials.has_images:
        (asset,) = folder.glob("*_low.glb")
        options = texbake.RenderOptions(width=2 * TILE[0], height=2 * TILE[1])
        seen = compare_models(path, asset, n_views=1, options=options)
        return [Image.fromarray(seen.before[0]), Image.fromarray(seen.after[0])]
    (preview,) = folder.glob("*_preview.png")
    with Image.open(preview) as picture:
        return [panel(picture, which).copy() for which in (MODEL, ASSET)]


def sheet(entries: list[tuple[dict, Path, Path]]) -> Image.Image:
    """All models in rows of COLUMNS, each beside its asset."""
    cell = (2 * TILE[0] + 8, TILE[1] + 2 * LINE + 8)
    rows = -(-len(entries) // COLUMNS)
    canvas = Image.new("RGB", (COLUMNS * cell[0], rows * cell[1]), BACKGROUND)
    draw, font = ImageDraw.Draw(canvas), ImageFont.load_default(13)
    for index, (entry, path, folder) in enumerate(entries):
        x, y = index % COLUMNS * cell[0], index // COLUMNS * cell[1]
        for place, picture in enumerate(pictures_of(path, folder) if "faces" in entry else []):
            fitted = ImageOps.pad(picture.convert("RGB"), TILE, color=BACKGROUND)
            canvas.paste(fitted, (x + place * TILE[0] + 4, y + 4))
        made = entry.get("faces")
        below = f"{entry['triangles']:,} to {made:,} triangles" if made else "no asset: an error"
        draw.text((x + 6, y + TILE[1] + 4), entry["name"][:36], fill=(235, 235, 235), font=font)
        draw.text((x + 6, y + TILE[1] + 4 + LINE), below, fill=(160, 164, 170), font=font)
    return canvas


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", type=Path)
    parser.add_argument("names", nargs="*")
    parser.add_argument("--faces", type=int)
    parser.add_argument("--picture", type=Path)
    arguments = parser.parse_args()
    print(
        "| model | triangles | asset | bare | with its normal map | displaced as well "
        "| warnings | time |\n|---|---|---|---|---|---|---|---|"
    )
    entries = []
    for path in models(arguments.names):
        folder = arguments.out / name_of(path)
        entries.append((make_asset(path, folder, arguments.faces), path, folder))
        print(row(entries[-1][0]), flush=True)
    figures = [entry for entry, *_ in entries if "compare" in entry]
    better = [
        normals["psnr_db"] - bare["psnr_db"]
        for normals, bare in (
            (entry["compare"]["mapped"], entry["compare"]["bare"]) for entry in figures
        )
        if normals and None not in (normals["psnr_db"], bare["psnr_db"])
    ]
    print(
        f"\n{len(figures)} of {len(entries)} models gave an asset; the normal map "
        f"changes PSNR by {np.median(better):+.1f} dB in the median."
    )
    if arguments.picture:
        sheet(entries).save(arguments.picture, optimize=True, quality=85)


if __name__ == "__main__":
    main()

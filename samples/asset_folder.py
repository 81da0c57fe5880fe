"""Run the whole job on every mesh of a folder and write a table of the results.

python asset_folder.py [IN_FOLDER] [OUT_FOLDER] [--faces N] [--size PX]

Without folders it makes some meshes first. A failed asset stops no other; the exit code is 1 if one
failed or came out worse than the limits below.
"""

import argparse
import csv
import sys
from pathlib import Path

import texbake

MESH_SUFFIXES = {".obj", ".ply", ".stl", ".off", ".glb", ".gltf"}
MOST_MISSED_PERCENT = 1.0
MOST_DEGREES = 10.0


def make_some_meshes(folder: Path) -> None:
    """Write three high-poly meshes, one of them broken on purpose."""
    from texbake.mesh.shapes import icosphere, orange

    folder.mkdir(parents=True, exist_ok=True)
    texbake.write_mesh(orange(60_000), folder / "orange.ply")
    texbake.write_mesh(icosphere(6), folder / "ball.obj")
    (folder / "broken.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 nan\nf 1 2 3\n")


def process(path: Path, folder: Path, options: texbake.RunOptions) -> dict[str, str]:
    """Run one asset and return its row of the table, with the error if it failed."""
    row = {"asset": path.name, "result": "good", "faces": "", "missed %": "", "degrees": ""}
    try:
        result = texbake.run(texbake.read_mesh(path), folder / path.stem, options)
    except texbake.TexbakeError as error:
        return row | {"result": f"failed: {error}"}
    missed, degrees = result.baked.report.miss_percent, result.comparison.mapped.mean_deg
    if missed > MOST_MISSED_PERCENT or degrees > MOST_DEGREES:
        row["result"] = "worse than the limits"
    return row | {
        "faces": str(result.low.n_faces),
        "missed %": f"{missed:.3f}",
        "degrees": f"{degrees:.2f}",
    }


def main() -> int:
    """Run all assets, write the table and return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("assets", nargs="?", type=Path)
    parser.add_argument("out", nargs="?", type=Path, default=Path("asset_folder_sample"))
    parser.add_argument("--faces", type=int, default=500)
    parser.add_argument("--size", type=int, default=512)
    arguments = parser.parse_args()
    assets = arguments.assets
    if assets is None:
        assets = arguments.out / "assets"
        make_some_meshes(assets)
    options = texbake.RunOptions(n_faces=arguments.faces, size=arguments.size)

    paths = sorted(path for path in assets.iterdir() if path.suffix.lower() in MESH_SUFFIXES)
    rows = [process(path, arguments.out, options) for path in paths]
    with (arguments.out / "assets.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, fieldnames=list(rows[0]) if rows else ["asset"])
        writer.writeheader()
        writer.writerows(rows)
    for row in rows:
        print(f"{row['asset']:<20} {row['missed %']:>8} {row['degrees']:>8}  {row['result']}")
    return 0 if all(row["result"] == "good" for row in rows) else 1


if __name__ == "__main__":
    sys.exit(main())

"""The job in Python: a mesh made with NumPy, and several maps from one set of rays.

python python_api.py [FOLDER]
"""

import sys
from pathlib import Path

import numpy as np

import texbake


def fluted_vase(n_rows: int = 400, n_columns: int = 800) -> texbake.Mesh:
    """Make a closed vase with winding flutes and a hammered finish."""
    height = np.linspace(-1, 1, n_rows)[:, np.newaxis]
    angle = np.linspace(0, 2 * np.pi, n_columns, endpoint=False)[np.newaxis]
    profile = 0.45 + 0.2 * np.cos(2.6 * height) + 0.05 * np.sin(5 * height)
    flutes = 0.02 * np.cos(18 * angle + 3 * height)
    hammered = 0.004 * np.sin(60 * angle) * np.sin(50 * height)
    radius = (profile + flutes + hammered) * np.sqrt(np.clip(1 - height**14, 0, None))
    x, z = radius * np.cos(angle), -radius * np.sin(angle)
    positions = np.stack([x, np.broadcast_to(height, x.shape), z], axis=-1).reshape(-1, 3)

    row = np.arange(n_rows - 1)[:, np.newaxis] * n_columns
    here, there = np.arange(n_columns), (np.arange(n_columns) + 1) % n_columns
    a, b, c, d = row + here, row + there, row + n_columns + there, row + n_columns + here
    triangles = np.stack([np.stack([a, b, c], axis=-1), np.stack([a, c, d], axis=-1)], axis=2)
    return texbake.Mesh(positions=positions, faces=triangles.reshape(-1, 3), name="vase")


def main(folder: Path) -> None:
    """Make the vase, a low-poly version of it and its maps in a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    high = fluted_vase()

    # A mesh never changes: each step returns a new one, which shares the arrays that stay the same.
    low = texbake.simplify(high, 1500)
    low = texbake.unwrap(low, size=1024, padding=4)
    print(f"{high.n_faces:,} triangles to {low.n_faces:,}")
    print(f"stretch (Sander L2, 1 is best): {texbake.distortion(low).stretch.l2:.3f}")

    # `keep_hits` keeps what the rays hit, so that further maps cast none.
    options = texbake.BakeOptions(size=1024, samples=4, padding=4, keep_hits=True)
    baked = texbake.bake(high, low, options)
    for label, figure in baked.report.table():
        print(f"  {label:<20} {figure}")
    normal_map = baked.maps["normal"]
    normal_map.write(folder / "normal.png")
    normal_map.write(folder / "normal_directx.tga", convention="directx")

    others = texbake.BakeOptions(maps=("displacement", "normal"), space="object", padding=4)
    remapped = texbake.remap(baked, high, low, others)
    remapped.maps["displacement"].write(folder / "displacement.exr")
    remapped.maps["normal"].write(folder / "normal_object.png")

    # Files for other programs, a picture, and how close the result comes to the high-poly mesh.
    texbake.write_mesh(low, folder / "vase.glb", normal_map=folder / "normal.png")
    frame = texbake.render(low, normal_map=normal_map.values)
    frame.write(folder / "preview.png")
    comparison = texbake.compare(high, low, normal_map=normal_map.values)
    print(
        f"mean angle between normals: {comparison.mapped.mean_deg:.2f} degrees, "
        f"{comparison.bare.mean_deg:.2f} without the map"
    )


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "python_api_sample"))

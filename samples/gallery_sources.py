"""Draw the pictures, profiles and meshes that the scenes of the gallery use, all of them by code.

python gallery_sources.py [FOLDER]
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

import texbake
from texbake.baking.texture.options import PhotoOptions, SolidOptions
from texbake.baking.texture.photos import Photo, PhotoCamera, bake_photos
from texbake.baking.texture.solid import bake_solid
from texbake.jobs.light_maps import bake_light_maps
from texbake.mesh.compose import join_meshes
from texbake.mesh.shapes import cube
from texbake.texture.cube_map import from_latitude_longitude
from texbake.texture.heights_and_normals import height_to_normal
from texbake.texture.lookup import ramp_lookup
from texbake.texture.options import HeightToNormalOptions
from texbake.texture.procedures import evaluate

SCENES = Path(__file__).parent / "scenes"

# Radius and height, from the foot to the knob of the lid.
POT = """\
0 0
0.46 0
0.48 0.035
0.50 0.06
0.66 0.16
0.80 0.34
0.86 0.54
0.82 0.74
0.70 0.92
0.58 1.03
0.60 1.07
0.57 1.10
0.50 1.13
0.36 1.20
0.20 1.245
0.09 1.27
0.07 1.30
0.10 1.35
0.11 1.39
0.08 1.43
0 1.445
"""
# Of a vase, coarsely: up the outside, over the lip, down the inside.
VASE = (
    (0.0, 0.0), (0.25, 0.0), (0.50, 0.01), (0.58, 0.06), (0.70, 0.30), (0.72, 0.60), (0.62, 0.90),
    (0.44, 1.20), (0.30, 1.45), (0.29, 1.60), (0.40, 1.78), (0.44, 1.80), (0.42, 1.815),
    (0.36, 1.79), (0.25, 1.62), (0.26, 1.45), (0.34, 1.25), (0.20, 1.10), (0.0, 1.08),
)  # fmt: skip
# Centers and radii of the tubes of the pot, as control points of cubic curves.
SPOUT = (
    ((0.62, 0.34), (0.98, 0.40), (1.00, 0.70), (1.18, 0.92), (1.24, 0.99), (1.30, 1.03),
     (1.36, 1.05)),
    (0.24, 0.19, 0.13, 0.105, 0.10, 0.10, 0.11),
)  # fmt: skip
HANDLE = (
    ((-0.58, 0.92), (-0.86, 1.06), (-1.26, 1.08), (-1.26, 0.74), (-1.26, 0.48), (-1.02, 0.30),
     (-0.72, 0.28)),
    (0.075, 0.075, 0.075, 0.075, 0.075, 0.075, 0.075),
)  # fmt: skip
# Control points of a quarter circle, as a cubic curve: error 0.03 % of the radius.
_QUARTER = 0.5522847498


def main(scenes: Path) -> None:
    """Write everything; what is baked from scenes comes last."""
    textures, meshes = scenes / "textures", scenes / "meshes"
    for folder in textures, meshes:
        folder.mkdir(parents=True, exist_ok=True)
    write_meshes(meshes)
    write_earth(textures)
    write_tiles(textures)
    write_slides(textures)
    write_sky(textures)
    write_small_maps(textures)
    write_scan(textures)
    write_ranges(textures)
    write_orange(scenes)
    write_bakes(scenes)


# Meshes


def write_meshes(folder: Path) -> None:
    """Write the pot, its spout and handle, a vase, a sheet, and a colored ring."""
    (folder / "pot.txt").write_text(POT)
    write_rows(folder / "vase.txt", smooth(np.array(VASE), 6))
    for name, (centers, radii) in {"spout": SPOUT, "handle": HANDLE}.items():
        patches = tube(np.array(centers), np.array(radii))
        write_rows(folder / f"{name}.txt", patches.reshape(-1, 3), head=f"{len(patches)}\n")
    sheet = crowded_sheet()
    write_rows(folder / "sheet_with_uvs.txt", sheet)
    write_rows(folder / "sheet.txt", sheet[:, :3])
    ring = texbake.make("torus", resolution=(40, 20), minor_radius=0.5)
    colors = 0.5 + 0.5 * ring.positions / np.abs(ring.positions).max(axis=0)
    ring = texbake.Mesh(
        positions=ring.positions, faces=ring.faces, colors=colors.astype(np.float32)
    )
    texbake.write_mesh(ring, folder / "colored.ply")


def crowded_sheet() -> np.ndarray:
    """(16, 5): points of a patch that crowd in a corner, with coordinates like their places."""
    places = np.array([0.0, 0.15, 0.3, 1.0])
    u, v = (grid.ravel() for grid in np.meshgrid(places, places))
    x, y = 2.0 * u - 1.0, 2.0 * v - 1.0
    return np.column_stack([x, y, 0.5 * np.sin(2.2 * x) * np.cos(1.6 * y), u, v])


def smooth(points: np.ndarray, n_steps: int) -> np.ndarray:
    """Points on the curve of Catmull and Rom through some, `n_steps` from one to the next."""
    ends = np.concatenate([points[:1], points, points[-1:]])
    before, first, second, after = (ends[k : len(points) - 1 + k, None] for k in range(4))
    t = (np.arange(n_steps) / n_steps)[None, :, None]
    curve = 0.5 * (
        2 * first
        + (second - before) * t
        + (2 * before - 5 * first + 4 * second - after) * t**2
        + (3 * first - before - 3 * second + after) * t**3
    )
    curve = np.concatenate([curve.reshape(-1, 2), points[-1:]])
    return np.column_stack([np.maximum(curve[:, 0], 0.0), curve[:, 1]])


def write_rows(path: Path, rows: np.ndarray, head: str = "") -> None:
    """Write numbers, a row a line."""
    lines = (" ".join(f"{x:.5f}" for x in row) for row in rows)
    path.write_text(head + "\n".join(lines) + "\n")


def tube(centers: np.ndarray, radii: np.ndarray) -> np.ndarray:
    """(P, 4, 4, 3) patches around a plane curve of cubic pieces, four to each piece.

    Rings stand across the polygon of control points, which is near enough for a spout.
    """
    along = np.gradient(centers, axis=0)
    along /= np.linalg.norm(along, axis=1)[:, None]
    across = np.stack([-along[:, 1], along[:, 0], np.zeros(len(along))], axis=1)
    middle = np.concatenate([centers, np.zeros((len(centers), 1))], axis=1)
    quarter = np.array([[1.0, 0.0], [1.0, _QUARTER], [_QUARTER, 1.0], [0.0, 1.0]])
    patches = []
    for piece in range(len(centers) // 3):
        for turn in range(4):
            a, b = [(1, 0), (0, 1), (-1, 0), (0, -1)][turn]
            sides = quarter @ np.array([[a, b], [-b, a]])
            patch = np.empty((4, 4, 3))
            for v in range(4):
                k = 3 * piece + v
                patch[v] = middle[k] + radii[k] * (
                    sides[:, :1] * across[k] - sides[:, 1:] * np.array([0.0, 0.0, 1.0])
                )
            patches.append(patch)
    return np.array(patches)


# Textures


def write_earth(folder: Path, width: int = 768) -> None:
    """Draw a planet with seas, and where it is wet and so shines."""
    height = width // 2
    points = globe(width, height)
    land = fractal(points * 1.55, seed=11, octaves=9, gain=0.56)
    detail = fractal(points * 5.0, seed=3, octaves=7, gain=0.6)
    latitude = np.abs(points[:, 1])
    level = land - 0.535
    ice = latitude + 0.12 * (detail - 0.5) > 0.93
    dry = np.clip(1.6 - 4.0 * np.abs(latitude - 0.38) + 5.0 * (detail - 0.5), 0.0, 1.0)
    deep = ramp(((0.004, 0.02, 0.085), (0.01, 0.055, 0.17), (0.03, 0.19, 0.30)), 1 + level / 0.2)
    green = ramp(((0.025, 0.085, 0.02), (0.06, 0.12, 0.03), (0.20, 0.17, 0.08)), level / 0.13)
    sand = ramp(((0.36, 0.25, 0.12), (0.42, 0.30, 0.16), (0.28, 0.20, 0.12)), level / 0.13)
    ground = green + dry[:, None] * (sand - green)
    snow = np.clip((level - 0.13 + 0.2 * (detail - 0.5)) / 0.03, 0.0, 1.0)[:, None]
    ground = ground + snow * (0.75 - ground)
    color = np.where((level > 0.0)[:, None], ground, deep)
    color[ice] = (0.78, 0.82, 0.86)
    sea = np.where((level > 0.0) | ice, 0.03, 0.9)
    save(folder / "earth.png", color.reshape(height, width, 3))
    save(folder / "earth_sea.png", sea.reshape(height, width), color=False)


def write_tiles(folder: Path, size: int = 384) -> None:
    """Draw bricks in mortar: colors, heights, the normals of those, and what they hide."""
    v, u = (np.mgrid[0:size, 0:size] + 0.5) / size
    row = np.floor(v * 6)
    across = u * 3 + 0.5 * (row % 2)
    x, y = across % 1.0, (v * 6) % 1.0
    # Distance from the edge of a brick, in heights of a row; the mortar is 0.1 wide.
    edge = np.minimum(np.minimum(x, 1 - x) * 2.0, np.minimum(y, 1 - y)) - 0.05
    grain = tiling(size, 24.0, seed=5)
    rough = tiling(size, 6.0, seed=8)
    rise = np.clip((edge + 0.05 * (rough - 0.5)) / 0.11, 0.0, 1.0)
    rise = rise * rise * (3 - 2 * rise)
    brick = np.floor(across % 3) + 7 * row
    lift = 0.12 * np.sin(12.9898 * brick + 4.1) ** 2
    height = rise * (0.78 + lift) + 0.1 * rise * (rough - 0.5) + 0.06 * grain
    tone = np.sin(78.233 * brick + 1.3)
    base = np.array([0.38, 0.12, 0.065]) * (1 + 0.28 * tone)[..., None]
    base = base + np.array([0.03, 0.045, 0.035]) * np.sin(41.3 * brick)[..., None]
    base *= (0.72 + 0.56 * rough)[..., None]
    mortar = np.array([0.36, 0.34, 0.30]) * (0.75 + 0.5 * grain)[..., None]
    color = mortar + rise[..., None] * (base - mortar)
    height = np.clip(height, 0.0, 1.0)
    save(folder / "bricks.png", color)
    save(folder / "bricks_height.png", height, color=False)
    normals = height_to_normal(height, HeightToNormalOptions(scale=0.035))
    save(folder / "bricks_normal.png", 0.5 * normals + 0.5, color=False)
    save(folder / "bricks_occlusion.png", 0.15 + 0.85 * rise, color=False)


def write_slides(folder: Path) -> None:
    """Draw a sunset, a window, a sticker and a fern."""
    height, width = 256, 384
    y, x = np.mgrid[0:height, 0:width] + 0.5
    x, y = x / height, 1 - y / height  # in heights of the picture, y up
    sky = ramp(((0.95, 0.42, 0.08), (0.75, 0.16, 0.16), (0.16, 0.06, 0.30), (0.02, 0.03, 0.18)),
               (y - 0.3) / 0.7)  # fmt: skip
    away = np.hypot(x - 0.95, y - 0.44)
    sky += np.exp(-8.0 * away)[..., None] * np.array([0.9, 0.5, 0.1])
    picture = np.where((away < 0.13)[..., None], (1.0, 0.85, 0.35), sky)
    for base, wave, tone in (
        (0.42, 0.10, (0.16, 0.05, 0.14)),
        (0.33, 0.075, (0.07, 0.03, 0.09)),
        (0.22, 0.05, (0.02, 0.015, 0.04)),
    ):
        ridge = base + wave * (np.sin(7 * x / (base + 0.2) + 9 * base) * 0.6
                               + np.sin(17 * x + 20 * base) * 0.4)  # fmt: skip
        picture = np.where((y < ridge)[..., None], tone, picture)
    save(folder / "sunset.png", picture)
    size = 256
    v, u = (np.mgrid[0:size, 0:size] + 0.5) / size
    bars = (np.abs(((u - 0.1) * 2.5) % 1.0 - 0.5) < 0.42) & (
        np.abs((v - 0.06) * 3.4 % 1 - 0.5) < 0.43
    )
    pane = bars & (np.abs(u - 0.5) < 0.4) & (np.abs(v - 0.5) < 0.44)
    save(folder / "window.png", np.where(pane[..., None], (1.0, 0.93, 0.78), 0.0))
    around, radius = np.arctan2(v - 0.5, u - 0.5), 2 * np.hypot(u - 0.5, v - 0.5)
    star = radius < 0.62 + 0.3 * np.cos(5 * (around + np.pi / 2))
    color = np.where((radius < 0.34)[..., None], (0.9, 0.75, 0.1), (0.65, 0.02, 0.05))
    save(folder / "sticker.png", np.concatenate([color, star[..., None]], axis=2))
    leaf = leaves(u, 1 - v)
    green = ramp(((0.16, 0.34, 0.04), (0.04, 0.14, 0.02)), v)
    save(folder / "leaves.png", np.concatenate([green, leaf[..., None]], axis=2))


def leaves(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """1 where a fern is, 0 elsewhere."""
    stem = 0.5 + 0.08 * np.sin(3 * v)
    shown = (np.abs(u - stem) < 0.012) & (v < 0.95)
    for k in range(11):
        middle = 0.10 + 0.078 * k
        length = 0.08 + 0.30 * np.sin(np.pi * (0.12 + 0.8 * k / 10)) ** 0.8
        side = np.abs(u - stem)
        bent = v - middle - 0.3 * side
        width = 0.034 * np.sqrt(np.clip(side / length, 0, 1)) * np.clip(1 - side / length, 0, 1) * 2
        shown |= (np.abs(bent) < width) & (side < length)
    return shown.astype(np.float64)


def write_sky(folder: Path, width: int = 1024) -> None:
    """Draw a sky over hills, all around, and the same as the six faces of a cube map."""
    height = width // 2
    points = globe(2 * width, 2 * height)
    x, y, z = points.T
    sky = ramp(
        ((0.72, 0.80, 0.88), (0.30, 0.50, 0.80), (0.08, 0.22, 0.58)), np.clip(y, 0, 1) ** 0.6
    )
    plane = np.stack([x, z], axis=1) / np.maximum(y, 0.02)[:, None]
    clouds = fractal(np.column_stack([plane * 0.9, np.zeros(len(y))]), seed=21, octaves=7)
    cloud = np.clip((clouds - 0.48) / 0.14, 0, 1) * np.clip(y / 0.25, 0, 1)
    sky = sky + cloud[:, None] * (0.92 - sky)
    around = np.arctan2(x, z)
    ridge = 0.02 + 0.10 * (fractal(np.column_stack([np.sin(around), np.cos(around), 0 * x]) * 3.0,
                                   seed=4, octaves=6) - 0.3)  # fmt: skip
    hills = ramp(((0.05, 0.10, 0.12), (0.16, 0.24, 0.28)), (ridge - y) * 8)
    sky = np.where((y < ridge)[:, None], hills, sky)
    spot = np.stack([x, z], axis=1) / np.maximum(-y, 0.03)[:, None]
    meadow = fractal(np.column_stack([spot * 2.0, np.ones(len(y))]), seed=9, octaves=6)
    far = np.clip(-y / 0.5, 0, 1)[:, None]
    ground = ramp(((0.05, 0.11, 0.02), (0.16, 0.22, 0.05), (0.28, 0.26, 0.10)), meadow * 1.4 - 0.2)
    ground = ground + (1 - far) * (np.array([0.13, 0.20, 0.16]) - ground)
    color = np.where((y < 0)[:, None], ground, sky)
    sun = points @ (np.array([0.45, 0.62, 0.64]) / np.linalg.norm([0.45, 0.62, 0.64]))
    color = np.where((sun > 0.9965)[:, None], 1.0, color + 0.5 * np.exp((sun[:, None] - 1) * 60))
    # The mean of 2 x 2 samples.
    color = np.clip(color, 0, 1).reshape(height, 2, width, 2, 3).mean(axis=(1, 3))
    save(folder / "sky.png", color)
    cube = from_latitude_longitude(color.astype(np.float32), size=128)
    for name, face in zip(
        ("right", "left", "up", "down", "back", "front"), cube.faces, strict=True
    ):
        save(folder / f"sky_{name}.png", face)


def write_small_maps(folder: Path, size: int = 256) -> None:
    """Draw a numbered checker, smears that dull a gloss, a vector field and letters on a panel."""
    save(folder / "checker.png", texbake.checker_image(512, 8))
    v, u = (np.mgrid[0:size, 0:size] + 0.5) / size
    smear = tiling(size, 5.0, seed=2, stretch=4.0)
    rings = 0.5 + 0.5 * np.cos(90 * np.hypot(u - 0.5, 0.8 * (v - 0.5)) + 8 * smear)
    save(folder / "smears.png", np.clip(1.5 * smear * (0.4 + 0.6 * rings), 0, 1), color=False)
    glow = (np.abs((u * 8) % 1 - 0.5) < 0.34) & (np.abs((v * 8) % 1 - 0.5) < 0.30)
    lit = glow & (np.sin(91.7 * np.floor(u * 8) + 47.3 * np.floor(v * 8)) > -0.15)
    save(folder / "windows.png", np.where(lit[..., None], (1.0, 0.62, 0.18), 0.0))
    # Hooks: up in the middle, and sideways at the top, about 0.5.
    v, u = (np.mgrid[0:128, 0:128] + 0.5) / 128
    x, y = (u * 3) % 1 - 0.5, (v * 3) % 1 - 0.5
    bump = np.clip(1 - 2.2 * np.hypot(x, y), 0, 1)
    vectors = np.stack([0.5 + 0.5 * bump**3, 0.5 + 0 * bump, 0.5 + 0.5 * np.sqrt(bump)], axis=2)
    texbake.write_image(vectors.astype(np.float32), folder / "hooks.png", bits=16)


# Bakes


def write_orange(scenes: Path) -> None:
    """Photograph the displaced orange from six sides, and blend the photographs on a sphere."""
    scene = texbake.read_scene(scenes / "orange_displaced.toml")
    orange = replace(scene.objects[0], transform=None)
    options = texbake.RenderOptions(width=320, height=320, supersampling=2, fov=30.0)
    photos = []
    for direction in (
        (0, 0, 1),
        (0.95, 0.2, -0.35),
        (-0.95, -0.2, -0.35),
        (0, 1, 0.05),
        (0, -1, 0.05),
    ):
        eye = tuple(4.4 * np.array(direction) / np.linalg.norm(direction))
        view = texbake.CameraView(position=eye, target=(0.0, 0.0, 0.0), fov=30.0)
        lamp = texbake.Light(kind="directional", direction=(-0.2, -0.35, -1.0), follows_camera=True,
                             intensity=0.45)  # fmt: skip
        sky = texbake.Ambient(color=(0.55, 0.55, 0.55))
        shot = texbake.Scene(
            objects=(orange,), lighting=texbake.Lighting(lights=(lamp,), ambient=sky), view=view
        )
        picture = texbake.render_scene(shot, options).color[:, :, :3]
        camera = PhotoCamera(position=eye, target=(0.0, 0.0, 0.0), fov=30.0)
        photos.append(Photo(image=picture, camera=camera))
    sphere = texbake.make("sphere", resolution=(128, 64))
    baked = bake_photos(sphere, photos, PhotoOptions(size=(768, 384), falloff=3.0, max_angle=70.0))
    save(scenes / "textures" / "orange_photo.png", baked.values)


def write_ranges(folder: Path) -> None:
    """Write a cylindrical range image of a vase with a photograph, and a depth image of balls."""
    v = 1.0 - (np.arange(128)[:, None] + 0.5) / 128
    angle = 2.0 * np.pi * ((np.arange(256) + 0.5) / 256 - 0.5)
    radius = 0.5 + 0.2 * np.sin(5.0 * v + 0.6) + 0.03 * np.cos(6.0 * angle + 4.0 * v)
    radius[40:52, 120:132] = 0.0  # where the scanner saw nothing
    texbake.write_image(radius[..., None].astype(np.float32), folder / "range_radius.png", bits=16)
    bands = 0.5 + 0.5 * np.sin(40.0 * v + np.sin(6.0 * angle))
    photo = np.array([0.72, 0.46, 0.28]) + bands[..., None] * [-0.45, -0.15, 0.22]
    save(folder / "range_photo.png", photo)

    side = (2.0 * (np.arange(160) + 0.5) / 160 - 1.0) * np.tan(np.radians(14.0))
    x, y = np.meshgrid(side, -side)
    depth = np.full(x.shape, np.inf)
    for center, size in (
        ((-0.4, 0.3, -5.2), 0.7),
        ((0.5, 0.1, -4.6), 0.5),
        ((0.0, -0.6, -5.0), 0.45),
    ):
        # The ray (x, y, -1) t meets the ball where |ray t - center| = size.
        a, b = x * x + y * y + 1.0, x * center[0] + y * center[1] - center[2]
        root = b * b - a * (np.dot(center, center) - size * size)
        meets = (b - np.sqrt(np.maximum(root, 0.0))) / a
        depth = np.where(root > 0.0, np.minimum(depth, meets), depth)
    depth = np.where(np.isfinite(depth), depth / 10.0, 0.0)
    texbake.write_image(depth[..., None].astype(np.float32), folder / "range_depth.png", bits=16)


def write_scan(folder: Path, size: int = 48) -> None:
    """Write a volume like a scan: shells of different density, with folds."""
    steps = (np.arange(size) + 0.5) / size * 2.0 - 1.0
    z, y, x = np.meshgrid(steps, -steps, steps, indexing="ij")
    folds = fractal(np.stack([x, y, z], axis=-1).reshape(-1, 3) * 1.7, seed=3, octaves=4)
    radius = np.sqrt(x**2 + 1.2 * y**2 + z**2) + 0.45 * (folds.reshape(x.shape) - 0.5)
    density = 0.5 + 0.5 * np.cos(9.0 * radius)
    density *= np.clip(1.6 - 1.1 * radius, 0.0, 1.0)
    np.save(folder / "scan.npy", np.round(255.0 * density).astype(np.uint8))


def write_bakes(scenes: Path) -> None:
    """Bake marble into the atlas of a vase, and the light of a room into its walls."""
    vase = texbake.make("revolution", profile=smooth(np.array(VASE), 2), resolution=(40, 1))
    vase = vase.replace(normals=None, normal_faces=None, uvs=None, uv_faces=None)
    vase = texbake.unwrap(vase, method="atlas", size=384)
    texbake.write_mesh(vase, scenes / "meshes" / "vase_atlas.ply")
    options = SolidOptions(procedure="marble", size=384, samples=16, parameters={"seed": 5})
    bake_solid(vase, options).write(scenes / "textures" / "baked_marble.png")
    room = texbake.read_scene(scenes / "light_map_room.toml")
    baked = bake_light_maps(room, texbake.BakeOptions(size=192, samples=16))
    for item in baked.maps:
        save(scenes / "textures" / f"light_{item.name}.png", item.values)
    write_stairs(scenes)


def write_stairs(scenes: Path) -> None:
    """Make steps whose bricks repeat on the first set, and bake their light on a second one."""
    block = cube()
    low, high = block.bounds
    unit = (block.positions - low) / (high - low) - (0.5, 0.0, 1.0)
    steps = [
        block.replace(positions=unit * (2.4, 0.5, depth) + (0.0, 0.5 * i, 1.4 - 2.8 + depth))
        for i, depth in enumerate((2.8, 1.9, 1.0))
    ]
    ground = texbake.make("plane", width=6, height=5)
    ground = texbake.transform(ground, texbake.TransformOptions(rotate=(-90.0, 0.0, 0.0)))
    stairs = join_meshes([ground, *steps]).replace(normals=None, normal_faces=None)
    corners = stairs.positions[stairs.faces]
    edges = corners[:, 1:] - corners[:, :1]
    across = np.abs(np.cross(edges[:, 0], edges[:, 1])).argmax(axis=1)
    axes = np.array([[2, 1], [0, 2], [0, 1]])[across]
    uvs = np.take_along_axis(corners, axes[:, None, :].repeat(3, axis=1), axis=2)
    rows = np.arange(3 * len(uvs), dtype=np.int32).reshape(-1, 3)
    stairs = stairs.replace(uvs=uvs.reshape(-1, 2), uv_faces=rows)
    stairs = texbake.unwrap(stairs, uv_set="lightmap", size=384, padding=4)
    texbake.write_mesh(stairs, scenes / "meshes" / "stairs.glb")
    lamp = texbake.Light(kind="point", position=(1.9, 2.4, 1.6), color=(1.0, 0.75, 0.45),
                         intensity=6.0)  # fmt: skip
    sky = texbake.Ambient(color=(0.10, 0.13, 0.2))
    item = texbake.SceneObject(mesh=stairs.on_uv_set("lightmap"))
    scene = texbake.Scene(objects=(item,), lighting=texbake.Lighting(lights=(lamp,), ambient=sky))
    (light,) = bake_light_maps(scene, texbake.BakeOptions(size=384, samples=16)).maps
    save(scenes / "textures" / "light_stairs.png", light.values)


# Small parts


def globe(width: int, height: int) -> np.ndarray:
    """(H * W, 3) unit vectors of a latitude-longitude picture; its middle column looks to -z."""
    v, u = np.mgrid[0:height, 0:width] + 0.5
    azimuth, elevation = (u / width - 0.5) * 2 * np.pi, (0.5 - v / height) * np.pi
    flat = np.cos(elevation)
    points = np.stack([flat * np.sin(azimuth), np.sin(elevation), -flat * np.cos(azimuth)], axis=-1)
    return points.reshape(-1, 3)


def fractal(points: np.ndarray, **parameters: float) -> np.ndarray:
    """Return noise at many scales, about 0.5."""
    return evaluate("fractal", points, parameters=parameters)[:, 0].astype(np.float64)


def tiling(size: int, frequency: float, *, seed: int, stretch: float = 1.0) -> np.ndarray:
    """(size, size) noise that tiles: on the product of two circles, cut to three dimensions."""
    v, u = (np.mgrid[0:size, 0:size] + 0.5) / size * 2 * np.pi
    ring = frequency / (2 * np.pi)
    # A torus: distances along v change a little with u, which noise does not show.
    wide = 3.0 * ring + ring * np.cos(u) / stretch
    points = np.stack([wide * np.cos(v), wide * np.sin(v), ring * np.sin(u)], axis=-1)
    return fractal(points.reshape(-1, 3), seed=seed).reshape(size, size)


def ramp(stops: tuple, values: np.ndarray) -> np.ndarray:
    """(..., 3) colors between stops, at values from 0 to 1."""
    values = np.asarray(values, np.float32)
    colors = ramp_lookup(np.array(stops, np.float32), values.ravel())
    return colors.reshape(*values.shape, 3).astype(np.float64)


def save(path: Path, pixels: np.ndarray, *, color: bool = True) -> None:
    """Write 8 bits a channel."""
    texbake.write_image(np.asarray(pixels, np.float32), path, color=color, bits=8)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else SCENES)

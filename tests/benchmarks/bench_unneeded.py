"""What settings cost that cannot change a pixel: strengths of 0, dark lights, hidden maps.

    python tests/benchmarks/bench_unneeded.py [--runs 9] [--texels 4096]

A sphere is drawn with such a setting and without it, in turns, each time from the start: the images
are read anew. Prints a table in Markdown: the medians of both in milliseconds of all threads, their
ratio (1.00 is no cost), the spread of the pictures without it against themselves, and the memory of
what was made for the setting.
"""

from __future__ import annotations

import argparse
import statistics
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from texbake.mapping.options import UnwrapOptions
from texbake.mesh.shapes import uv_sphere
from texbake.rendering.draw import draw, prepare
from texbake.rendering.options import RenderOptions
from texbake.rendering.scene.lights import Ambient, Environment, Light, Lighting, Shadow
from texbake.rendering.scene.material import (
    BumpMap,
    Displacement,
    Material,
    NormalMap,
    Parallax,
    ProjectedTexture,
    Reflection,
    Refraction,
)
from texbake.rendering.scene.scene import Scene, SceneObject, camera_of
from texbake.rendering.scene.textures import ImageTexture
from texbake.rendering.scene.transforms import projector_matrix
from texbake.texture.image import write_image

SUN = Light(direction=(0.3, -0.4, -1.0))
LIT = Lighting(lights=(SUN,))
OPTIONS = RenderOptions(width=320, height=240)

# A setting, the scene with it and the scene without it: lighting and material of each.
Case = tuple[str, Lighting, dict[str, Any], Lighting, dict[str, Any]]


def cases(image: ImageTexture) -> list[Case]:
    """List the settings."""
    unlit, lambert = {"shading": "unlit"}, {"shading": "lambert"}
    normals = NormalMap(texture=image, space="tangent", convention="opengl")
    away = projector_matrix(position=(0.0, 0.0, 5.0), target=(0.0, 0.0, 9.0))
    spot = Light(name="spot", kind="spot", position=(0.0, 0.0, 5.0), direction=(0.0, 0.0, 1.0))
    dark = Environment(image=image.image, lighting=True, intensity=0.0, background=False)
    materials: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
        "normal map, unlit": (unlit, {"normal_map": normals}),
        "bump map, unlit": (unlit, {"bump_map": BumpMap(texture=image)}),
        "occlusion map without ambient light": (lambert, {"occlusion": image}),
        "parallax that moves no texture": (lambert, {"parallax": Parallax(texture=image)}),
        "parallax of depth 0": (lambert, {"parallax": Parallax(texture=image, depth=0.0)}),
        "bump map of height 0": (lambert, {"bump_map": BumpMap(texture=image, height=0.0)}),
        "normal map of strength 0": (lambert, {"normal_map": replace(normals, strength=0.0)}),
        "displacement of height 0": (
            lambert, {"displacement": Displacement(texture=image, height=0.0)},
        ),
        "reflection of strength 0": (lambert, {"reflection": Reflection(strength=0.0)}),
        "refraction of factor 0": (
            lambert, {"refraction": Refraction(strength=replace(image, factor=0.0))},
        ),
        "emission of factor 0": (lambert, {"emission": replace(image, factor=0.0)}),
        "projected picture of strength 0": (
            lambert,
            {"projected": (ProjectedTexture(texture=image, matrix=np.eye(4), strength=0.0),)},
        ),
        "projected picture aimed elsewhere": (
            lambert, {"projected": (ProjectedTexture(texture=image, matrix=away),)},
        ),
        "mapping that nothing reads": (lambert, {"mapping": UnwrapOptions()}),
        "color behind a perfect mirror": (
            {"reflection": Reflection()}, {"base_color": image, "alpha_mode": "opaque"},
        ),
    }  # fmt: skip
    found: list[Case] = [
        (name, LIT, common | part, LIT, common) for name, (common, part) in materials.items()
    ]
    with_spot = replace(LIT, lights=(SUN, replace(spot, profile=image)))
    found.append(("cookie of a spot turned away", with_spot, lambert, LIT, lambert))
    x, y, z = camera_of(scene_of(LIT, lambert), OPTIONS).eye.tolist()
    behind = replace(spot, position=(-x, -y, -z), direction=(x, y, z))
    with_lamp = replace(LIT, lights=(SUN, behind))
    with_both = replace(LIT, lights=(SUN, replace(behind, shadow=Shadow(), profile=image)))
    found.append(("cookie and shadow of a lamp behind it", with_both, lambert, with_lamp, lambert))
    with_sky = replace(LIT, environment=dark)
    found.append(("environment of intensity 0", with_sky, lambert, LIT, lambert))
    even = Lighting(ambient=Ambient(color=(0.5, 0.5, 0.5)))
    mapped = lambert | {"normal_map": normals}
    found.append(("normal map in even light", even, mapped, even, lambert))
    return found


def scene_of(lighting: Lighting, material: dict[str, Any]) -> Scene:
    """Return a sphere with a material in a light."""
    fields = dict(material)
    mapping = fields.pop("mapping", None)
    item = SceneObject(
        mesh=uv_sphere(32, 64), mapping=mapping, material=Material(**fields), name="ball"
    )
    return Scene(objects=(item,), lighting=lighting)


def timed(scene: Scene) -> tuple[float, int, bytes]:
    """Milliseconds of one picture, the bytes of its passes, and the picture."""
    camera = camera_of(scene, OPTIONS)
    start = time.process_time()
    frame = draw(prepare(scene, OPTIONS), camera)
    taken = 1e3 * (time.process_time() - start)
    return taken, sum(cost.n_bytes for cost in frame.costs.by_name.values()), frame.color.tobytes()


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=9)
    parser.add_argument("--texels", type=int, default=4096)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "map.png"
        rng = np.random.default_rng(0)
        write_image(rng.integers(1, 255, (given.texels, given.texels, 3), np.uint8), path)
        print("| setting | with | without | ratio | spread | memory, kB |")
        print("|---|---:|---:|---:|---:|---:|")
        for name, lighting, material, bare_lighting, bare in cases(ImageTexture(image=path)):
            scenes = scene_of(lighting, material), scene_of(bare_lighting, bare)
            timed(scenes[0]), timed(scenes[1])
            runs = [(timed(scenes[0]), timed(scenes[1])) for _ in range(given.runs)]
            first, second = (statistics.median(run[k][0] for run in runs) for k in (0, 1))
            half = len(runs) // 2
            spread = statistics.median(run[1][0] for run in runs[:half]) / statistics.median(
                run[1][0] for run in runs[half:]
            )
            more = (runs[0][0][1] - runs[0][1][1]) / 1e3
            same = "" if runs[0][0][2] == runs[0][1][2] else " (the pictures differ)"
            print(f"| {name}{same} | {first:.1f} | {second:.1f} | {first / second:.2f} "
                  f"| {spread:.2f} | {more:,.0f} |")  # fmt: skip


if __name__ == "__main__":
    main()

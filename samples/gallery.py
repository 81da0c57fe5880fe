"""Draw the gallery: a picture of every scene in scenes/, and the page that shows them.

python gallery.py              # draws all textures, all pictures and the page
python gallery.py marble fog   # draws only these pictures
"""

import sys
import tempfile
from dataclasses import dataclass, field
from pathlib import Path

import gallery_sources
from PIL import Image

import texbake
from texbake.jobs.preview import render_side_by_side, side_by_side_options
from texbake.jobs.preview_scene import open_preview
from texbake.rendering.render import plan_scene

HERE = Path(__file__).parent
SCENES, PICTURES, PAGE = HERE / "scenes", HERE / "gallery", HERE / "gallery.md"

# Scenes in the order of the page.
SECTIONS = {
    "The orange, four ways": (
        "orange_colored", "orange_mapped", "orange_bump", "orange_displaced",
    ),
    "A planet": ("earth_spherical", "earth_cylindrical"),
    "Procedures": (
        "marble", "wood", "granite", "worley", "stripes", "checker", "noise", "value_noise",
        "fractal_turbulence", "turbulence_levels", "ramp", "legends", "volume", "baked_marble",
    ),
    "Shading models and the slots of a material": (
        "shading_models", "roughness_metalness", "material_map", "gloss_map", "emission",
        "vertex_colors", "occlusion_map", "opacity_mask", "transparency",
    ),
    "Relief": (
        "bump_forms", "bump_differences", "emboss", "vertex_shading", "normal_map", "parallax",
        "displacement_map", "vector_displacement",
    ),
    "Light": (
        "shadow_directional", "shadow_point", "shadow_spot", "slide_projector", "light_profile",
        "projected_texture", "projected_visibility", "hemisphere", "ambient_occlusion",
        "light_map_room", "light_map", "fog",
    ),
    "Environments": (
        "reflection", "cube_map", "refraction", "transmission", "rendered_environment",
        "environment_light",
    ),
    "Filters and coordinates": (
        "filters", "magnified", "wrap_modes", "uv_sets", "bezier_coordinates", "affine", "scanline",
        "mapping_orders", "range_images",
    ),
    "The inside of the renderer": (
        "buffers", "buffer_depth", "buffer_normals", "buffer_uv", "buffer_object-id", "texels",
        "buffer_texel-grid", "buffer_mip-level", "rings", "buffer_overdraw",
    ),
}  # fmt: skip
# Options of `side_by_side_options` beside the scene.
COMPARED = {
    "filters": {"filter": ("nearest", "bilinear", "trilinear", "ewa", "supersampled")},
    "magnified": {"filter": ("nearest", "bilinear", "bicubic")},
    "affine": {"interpolation": ("affine", "perspective")},
    "mapping_orders": {"mapping_order": ("screen", "texture", "texture-coverage")},
}
# For each buffer, the scene that shows it and its caption.
BUFFERS = {
    "depth": ("buffers", "Depth: white at the nearest surface, black at the farthest."),
    "normals": ("buffers", "Normals, shown as the color (n + 1) / 2."),
    "uv": ("buffers", "Texture coordinates within each tile: u as red, v as green."),
    "object-id": ("buffers", "One color per object."),
    "texel-grid": ("texels", "A checker of texels, gray where they are smaller than pixels."),
    "mip-level": ("texels", "The mip level that is read: one hue per level, gray for level 0."),
    "overdraw": ("rings", "How many triangles cover a sample: brighter for more."),
}
INTRODUCTION = """\
# Gallery

A picture of every effect, with the scene file that made it. [`gallery.py`](gallery.py) draws the
pictures, [`gallery_sources.py`](gallery_sources.py) the textures and meshes.

[Scene files](../docs/reference/scenes.md) and [passes](../docs/explanation/rendering.md) are
explained in the documentation. Under each picture stand the passes that
`texbake preview SCENE --explain` lists for it, except rasterizing, fragments and pixels, which
every picture has. Nothing else was run.
"""


@dataclass(frozen=True)
class Shot:
    """A picture of the page: a scene, and the options it is drawn with.

    `ways` are choices of `side_by_side_options`; several pictures stand in a row.
    """

    name: str
    scene: str
    caption: str
    ways: dict[str, tuple[str, ...]] = field(default_factory=dict)

    @property
    def scene_file(self) -> Path:
        """Path of the scene file."""
        return SCENES / f"{self.scene}.toml"

    @property
    def picture_file(self) -> Path:
        """Path of the picture."""
        return PICTURES / f"{self.name}.png"

    @property
    def options(self) -> str:
        """Command-line options beside the scene."""
        return " ".join(
            f"--{key.replace('_', '-')} {','.join(names)}" for key, names in self.ways.items()
        )


def shots() -> list[Shot]:
    """Every picture, in the order of the page."""
    found = []
    for name in (name for names in SECTIONS.values() for name in names):
        kind, _, buffer = name.partition("_")
        if kind == "buffer":
            found.append(Shot(name, *BUFFERS[buffer], {"buffer": (buffer,)}))
        else:
            found.append(Shot(name, name, caption(name), COMPARED.get(name, {})))
    return found


def caption(scene: str) -> str:
    """Return the comment at the head of a scene file."""
    words = []
    for line in (SCENES / f"{scene}.toml").read_text().splitlines():
        if not line.startswith("#"):
            break
        words.append(line.lstrip("# "))
    return " ".join(words)


def opened(shot: Shot, **changes: object) -> tuple[texbake.Scene, list]:
    """Return the scene, and the options of every picture in the row with their captions."""
    scene, options = open_preview(shot.scene_file, changes)
    return scene, side_by_side_options(options, shot.ways)


def passes(shot: Shot) -> list[str]:
    """Names of the passes that `--explain` lists, of all pictures in the row."""
    scene, ways = opened(shot)
    names = [item.name for _, options in ways for item in plan_scene(scene, options).passes]
    return list(dict.fromkeys(names))


def draw(shot: Shot) -> Image.Image:
    """Draw a picture as `texbake preview` does."""
    scene, ways = opened(shot)
    if len(ways) == 1:
        color = texbake.render_scene(scene, ways[0][1]).color[:, :, :3]
    else:
        color, _ = render_side_by_side(scene, ways)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "picture.png"
        texbake.write_image(color, path, color=True, bits=8)
        return Image.open(path).convert("RGB")


def page() -> str:
    """Text of the page."""
    by_name = {shot.name: shot for shot in shots()}
    parts = [INTRODUCTION]
    for title, names in SECTIONS.items():
        parts.append(f"## {title}\n")
        parts += [entry(by_name[name]) for name in names]
    return "\n".join(parts)


def entry(shot: Shot) -> str:
    """Text of one picture on the page."""
    title = shot.name.replace("_", " ").replace("-", " ").capitalize()
    options = f", with `{shot.options}`" if shot.options else ""
    return (
        f"### {title}\n\n![{title}](gallery/{shot.name}.png)\n\n{shot.caption}\n\n"
        f"Scene: [{shot.scene}.toml](scenes/{shot.scene}.toml){options}.\n"
        f"Passes: {', '.join(passes(shot))}.\n"
    )


def main(names: list[str]) -> None:
    """Draw the named pictures, or all of them, and the page."""
    PICTURES.mkdir(exist_ok=True)
    if not names:
        gallery_sources.main(SCENES)
    for shot in shots():
        if not names or shot.name in names:
            draw(shot).save(shot.picture_file, optimize=True)
            print(shot.picture_file.relative_to(HERE))
    PAGE.write_text(page())


if __name__ == "__main__":
    main(sys.argv[1:])

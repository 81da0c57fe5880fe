"""How right a photograph, a bump map, a normal map and a displacement map of an orange stay.

All four are put on one smooth sphere, and its pictures are held against those of the high-poly
orange, while the light turns around the orange and while the viewer does. The photograph is taken
at 0°, so the light in it stays where it was. A bump map and a normal map bend the shading and leave
the silhouette of the sphere; a displacement map moves the surface itself.

Based on: James F. Blinn, "Simulation of wrinkled surfaces", SIGGRAPH 1978, for bump maps; Robert
L. Cook, "Shade trees", SIGGRAPH 1984, for displacement.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from texbake.baking.bake import bake
from texbake.baking.options import BakeOptions
from texbake.baking.texture.options import PhotoOptions
from texbake.baking.texture.photos import Photo, PhotoCamera, bake_photos
from texbake.core import portable_math as pm
from texbake.files import PathLike, replacing
from texbake.mesh.mesh import Float32Array, Mesh
from texbake.mesh.shapes import orange, uv_sphere
from texbake.progress import Progress, Stages
from texbake.records import dataclass
from texbake.rendering.camera import Camera
from texbake.rendering.draw import Prepared, draw, prepare, relight
from texbake.rendering.options import RenderOptions
from texbake.rendering.resolve import Frame, picture_error
from texbake.rendering.scene.lights import Ambient, Light, Lighting
from texbake.rendering.scene.material import BumpMap, Displacement, Material, NormalMap
from texbake.rendering.scene.scene import Scene, SceneObject
from texbake.rendering.scene.textures import ImageTexture

if TYPE_CHECKING:
    from markupsafe import Markup

    from texbake.pages.asset_page import Plot

METHODS = ("photograph", "bump map", "normal map", "displacement map")
TURNS = ("light", "viewer")
ANGLES = tuple(range(0, 91, 15))

TRUTH = "high-poly mesh"

_ABOUT = (
    "A photograph, a bump map, a normal map and a displacement map of an orange, each on the same "
    "smooth sphere, against pictures of the high-poly orange. The photograph was taken at 0° and "
    "keeps the light of that moment. The bump map and the normal map follow the light and keep the "
    "silhouette of the sphere, which is most of their error. The displacement map follows both."
)

_TRIANGLES = 200_000
_RINGS, _SECTORS = 48, 96  # of the sphere
_MAP_SIZE, _PHOTO_SIZE = 1024, 512
_PIXELS, _PHOTO_PIXELS = 160, 512
_DISTANCE, _FOV_DEG = 4.4, 30.0
_LIGHT_DEG = -40.0  # azimuth of the light at 0°: from the left of the viewer
_PEEL = Material(base_color=(0.87, 0.25, 0.01), roughness=0.45)
_AMBIENT = Ambient(color=(0.16, 0.17, 0.20))
_OPTIONS = RenderOptions(
    width=_PIXELS, height=_PIXELS, supersampling=2, edges="supersample", background=(0.5, 0.5, 0.5)
)


@dataclass(frozen=True)
class TurnError:
    """How far one picture is from that of the high-poly orange."""

    turned: str  # what is turned: one of `TURNS`
    angle_deg: int  # by how much
    method: str  # one of `METHODS`
    # Root mean square difference in steps of 255 of sRGB, over the pixels that either shows.
    error: float
    outline_percent: float  # pixels that only one of both covers, as a share of the orange


@dataclass(frozen=True, eq=False)
class OrangeTurns:
    """All errors, and some of the pictures."""

    errors: tuple[TurnError, ...]  # by what is turned, then by method, then by angle
    # By what is turned, method or `high-poly mesh`, and angle; linear light.
    pictures: dict[tuple[str, str, int], Float32Array]

    def along(self, turned: str, method: str) -> list[TurnError]:
        """Return the errors of one method by angle."""
        return [e for e in self.errors if e.turned == turned and e.method == method]

    def write_csv(self, path: PathLike) -> None:
        """Write a row for each error."""
        text = io.StringIO()
        rows = csv.writer(text, lineterminator="\n")
        rows.writerow(["turned", "angle_deg", "method", "rms_of_255", "outline_percent"])
        for e in self.errors:
            figures = f"{e.error:.2f}", f"{e.outline_percent:.2f}"
            rows.writerow([e.turned, e.angle_deg, e.method, *figures])
        with replacing(path) as temporary:
            temporary.write_text(text.getvalue(), encoding="utf-8")


def measure_turns(
    angles: Sequence[int] = ANGLES, *, threads: int | None = None, progress: Progress = None
) -> OrangeTurns:
    """Turn light and viewer by degrees around an orange, and measure each method's error."""
    stages = Stages(progress)
    with stages.stage("bake the orange"):
        objects = _objects(threads)
    errors, pictures = [], {}
    total = len(TURNS) * len(objects) * len(angles)
    with stages.stage("turn the orange", total=total, unit="pictures") as advance:
        models = {name: prepare(_scene(item, 0), _OPTIONS, threads=threads)
                  for name, item in objects.items()}  # fmt: skip
        for turned in TURNS:
            frames = {}
            for name, item in objects.items():
                frames[name] = list(_turned(models[name], item, turned, angles))
                advance(len(angles))
                for angle, frame in zip(angles, frames[name], strict=True):
                    pictures[turned, name, angle] = frame.color[..., :3]
            truth = frames.pop(TRUTH)
            errors += [
                _error(turned, angle, name, frame, true)
                for name, shown in frames.items()
                for angle, frame, true in zip(angles, shown, truth, strict=True)
            ]
    return OrangeTurns(tuple(errors), pictures)


def turns_plot(threads: int | None, progress: Progress) -> Plot:
    """Measure the turns, and return their plot for a page."""
    from texbake.pages.asset_page import Plot

    turns = measure_turns(threads=threads, progress=progress)
    return Plot("The light and the viewer turn", _ABOUT, turns_svg(turns))


def turns_svg(turns: OrangeTurns) -> Markup:
    """Draw the errors over the angles: one frame for the light, one for the viewer."""
    from texbake.pages.plots import LineFrame, line_plots_svg

    frames = [
        LineFrame(
            f"The {turned} turns",
            f"angle of the {turned}",
            {
                method: [(e.angle_deg, e.error) for e in turns.along(turned, method)]
                for method in METHODS
            },
        )
        for turned in TURNS
    ]
    return line_plots_svg(
        frames,
        title="Error of the pictures of an orange over the angles of light and viewer",
        y_label="error of the picture (RMS, of 255)",
        x_step=30.0,
    )


def _objects(threads: int | None) -> dict[str, SceneObject]:
    """Return the high-poly orange and the sphere with each method's material."""
    high = orange(_TRIANGLES)
    sphere = _sphere_around(high)
    truth = SceneObject(mesh=high, material=_PEEL)
    maps = bake(
        high, sphere, BakeOptions(size=_MAP_SIZE, maps=("normal", "displacement"), threads=threads)
    ).maps
    normals = _texture(maps["normal"].values)
    heights = maps["displacement"].values
    materials = {
        "photograph": Material(shading="unlit", base_color=_photograph(truth, sphere, threads)),
        # Slopes of a bilinear height jump at every texel; those of a bicubic one do not.
        "bump map": replace(
            _PEEL, bump_map=BumpMap(texture=_texture(heights, "bicubic"), height=1.0)
        ),
        "normal map": replace(_PEEL, normal_map=NormalMap(texture=normals)),
        "displacement map": replace(
            _PEEL,
            displacement=Displacement(texture=_texture(heights), height=1.0, mid=0.0, edge_px=None),
        ),
    }
    painted = {
        name: SceneObject(mesh=sphere, material=material) for name, material in materials.items()
    }
    return {TRUTH: truth, **painted}


def _sphere_around(high: Mesh) -> Mesh:
    """Return a sphere with its poles on Y, as wide and as high as a mesh."""
    sphere = uv_sphere(_RINGS, _SECTORS)
    low, top = high.bounds
    upright = sphere.positions[:, [1, 2, 0]]
    return sphere.replace(positions=upright * (0.5 * (top - low)) + 0.5 * (low + top))


def _photograph(truth: SceneObject, sphere: Mesh, threads: int | None) -> ImageTexture:
    """Photograph the orange from where the viewer stands at 0°, and put it on the sphere."""
    options = replace(_OPTIONS, width=_PHOTO_PIXELS, height=_PHOTO_PIXELS)
    shot = draw(prepare(_scene(truth, 0), options, threads=threads), _camera(0))
    camera = PhotoCamera(position=_eye(0), target=(0.0, 0.0, 0.0), fov=_FOV_DEG)
    baked = bake_photos(
        sphere,
        [Photo(image=shot.color[..., :3], camera=camera)],
        # A sphere hides only what faces away.
        PhotoOptions(size=_PHOTO_SIZE, max_angle=90.0, falloff=0.0, occlusion=False,
                     threads=threads),
    )  # fmt: skip
    return _texture(baked.values)


def _texture(values: Float32Array, filter_: str = "bilinear") -> ImageTexture:
    return ImageTexture(image=values, filter=filter_, wrap="repeat")


def _turned(
    model: Prepared, item: SceneObject, turned: str, angles: Sequence[int]
) -> Iterator[Frame]:
    for angle in angles:
        if turned == "light":
            model = relight(model, _scene(item, angle))
        yield draw(model, _camera(angle if turned == "viewer" else 0))


def _scene(item: SceneObject, light_deg: float) -> Scene:
    azimuth = math.radians(_LIGHT_DEG + light_deg)
    shine = -pm.sin(azimuth), -0.5, -pm.cos(azimuth)
    return Scene(
        objects=(item,), lighting=Lighting(lights=(Light(direction=shine),), ambient=_AMBIENT)
    )


def _eye(viewer_deg: float) -> tuple[float, float, float]:
    """Where the viewer stands, a little above the orange's middle."""
    azimuth = math.radians(viewer_deg)
    return _DISTANCE * pm.sin(azimuth), 0.2 * _DISTANCE, _DISTANCE * pm.cos(azimuth)


def _camera(viewer_deg: float) -> Camera:
    return Camera.looking_at(
        _eye(viewer_deg), (0.0, 0.0, 0.0), up=(0.0, 1.0, 0.0), fov=math.radians(_FOV_DEG), near=0.1
    )


def _error(turned: str, angle: int, method: str, frame: Frame, true: Frame) -> TurnError:
    either = (frame.coverage > 0.0) | (true.coverage > 0.0)
    outline = np.abs(frame.coverage - true.coverage).sum() / true.coverage.sum()
    return TurnError(
        turned=turned,
        angle_deg=angle,
        method=method,
        error=picture_error(frame.color, true.color, either),
        outline_percent=100.0 * float(outline),
    )

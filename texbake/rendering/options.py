"""Every choice of a preview, with its default, written once for the API and the command line."""

from __future__ import annotations

import math
from dataclasses import dataclass

from texbake.durations import parse_seconds
from texbake.errors import OptionError
from texbake.rendering.scene.textures import FILTERS
from texbake.sampling.bounds import parse_picture_bound

MAX_SIZE = 16384  # pixels a side
MAX_SUPERSAMPLING = 16
# Visibility and shading keep about 50 bytes a sample, so this is about 13 GB.
MAX_SAMPLES = 2**28
# Sums and estimates of adaptive samples keep about 100 bytes a pixel: about 7 GB.
MAX_ADAPTIVE_PIXELS = 2**26
BACK_FACES = ("cull", "show")
UPS = ("y", "z")
INTERPOLATIONS = ("perspective", "affine", "scanline")
EDGES = ("multisample", "supersample")
BUFFERS = ("depth", "normals", "uv", "mip-level", "overdraw", "object-id", "texel-grid")

MAX_BOUNCES = 4

Rgb = tuple[float, float, float]

_CHOICES = {
    "back_faces": BACK_FACES,
    "up": UPS,
    "edges": EDGES,
    "interpolation": INTERPOLATIONS,
    "filter": FILTERS,
    "buffer": BUFFERS,
}


@dataclass(frozen=True, kw_only=True)
class RenderOptions:
    """What `render` and `compare` do where the caller does not say otherwise.

    Attributes
    ----------
    width, height : int
        Of the picture, in pixels: 1 to 16384.
    view : (azimuth, elevation) or (azimuth, elevation, distance)
        Where the camera stands, seen from the center of the mesh. Azimuth and elevation are in
        degrees: azimuth 0 looks at the front (from +z, or from -y where z is up) and grows
        counter-clockwise seen from above. Distance is in model units; None or left out: as far as
        it takes to have the whole mesh in the picture.
    up : str
        The axis of the world that is up in the picture: `y` or `z`.
    fov : float
        Vertical field of view in degrees, above 0 and below 180.
    supersampling : int
        Samples of a pixel along one side, 1 to 16: n x n samples, averaged.
    max_error : str or float, optional
        Samples are adaptive, all of them shaded: pixels get more until the estimated error of each
        is at most this, as a share of the way from black to white in sRGB: `2/255`, or 0.01. At
        most 341 each. `edges` does not count then, and `supersampling` only for shadow maps and
        ambient occlusion.
    time_budget : str or float, optional
        Wall-clock time that the picture may take, as `20s`, `2min`, or seconds: a short probe of
        the scene picks the least error that is predicted to fit, not below `max_error`.
    background : (r, g, b), optional
        Behind the mesh, sRGB-coded in [0, 1]; None: transparent.
    base_color : (r, g, b)
        Of the mesh where it has no albedo texture, sRGB-coded in [0, 1].
    back_faces : str
        Triangles seen from behind: `cull` leaves them out, `show` draws them with their normals
        turned to the camera.
    edges : str
        With `multisample` a pixel inside a triangle is shaded once, whatever the supersampling;
        with `supersample` every sample is shaded.
    interpolation : str
        `perspective`, correct; `affine`, linear on the screen, which is wrong in perspective;
        `scanline`, correct, computed step by step along edges and spans.
    filter : str, optional
        Filter of all image textures; None: each has its own.
    buffer : str, optional
        Show the inside of the renderer in place of the picture: `depth`, `normals`, `uv`,
        `mip-level`, `overdraw`, `object-id` or `texel-grid`.
    bounces : int
        Reflections within reflections of environments rendered from the scene, 0 to 4.
    max_triangles : int
        Most triangles that displacement may divide a mesh into.
    """

    width: int = 1280
    height: int = 720
    view: tuple[float, float] | tuple[float, float, float | None] = (30.0, 20.0)
    up: str = "y"
    fov: float = 35.0
    supersampling: int = 2
    max_error: str | float | None = None
    time_budget: str | float | None = None
    background: Rgb | None = (0.15, 0.16, 0.18)
    base_color: Rgb = (0.8, 0.8, 0.8)
    back_faces: str = "cull"
    edges: str = "multisample"
    interpolation: str = "perspective"
    filter: str | None = None
    buffer: str | None = None
    bounces: int = 1
    max_triangles: int = 4_000_000

    def __post_init__(self) -> None:
        for name in "width", "height":
            _check_range(name, getattr(self, name), MAX_SIZE)
        _check_range("supersampling", self.supersampling, MAX_SUPERSAMPLING)
        n_samples = self.width * self.height * self.supersampling**2
        if n_samples > MAX_SAMPLES:
            raise OptionError(
                f"supersampling: {self.width} x {self.height} pixels of {self.supersampling**2} "
                f"samples are {n_samples} samples, above {MAX_SAMPLES}; make one of them smaller"
            )
        if len(self.view) not in (2, 3) or not all(
            angle is not None and math.isfinite(angle) for angle in self.view[:2]
        ):
            raise OptionError(
                f"view: {self.view} is not azimuth and elevation in degrees and maybe a distance"
            )
        if self.distance is not None and not (0 < self.distance < math.inf):
            raise OptionError(f"view: the distance {self.distance} must be above 0")
        if not 0 < self.fov < 180:
            raise OptionError(f"fov: {self.fov} degrees is out of range; above 0 and below 180")
        for name in "background", "base_color":
            color = getattr(self, name)
            if color is not None and not (
                len(color) == 3 and all(0 <= channel <= 1 for channel in color)
            ):
                raise OptionError(f"{name}: {color} is not three numbers from 0 to 1")
        if self.base_color is None:
            raise OptionError("base_color: None is no color; give three numbers from 0 to 1")
        for name, choices in _CHOICES.items():
            value = getattr(self, name)
            if value not in choices and not (value is None and name in ("filter", "buffer")):
                raise OptionError(f"{name}: {value} is not one of {', '.join(choices)}")
        if not isinstance(self.bounces, int) or not 0 <= self.bounces <= MAX_BOUNCES:
            raise OptionError(f"bounces: {self.bounces} is out of range; it is 0 to {MAX_BOUNCES}")
        if self.max_triangles < 1:
            raise OptionError(f"max_triangles: {self.max_triangles} must be at least 1")
        self._check_targets()

    def _check_targets(self) -> None:
        """Raise `OptionError` where an error or a time is asked for that cannot be."""
        if self.max_error is not None:
            parse_picture_bound(self.max_error)
        if self.time_budget is not None:
            parse_seconds(self.time_budget)
        asked = "max-error" if self.max_error is not None else "time-budget"
        if self.is_adaptive and self.width * self.height > MAX_ADAPTIVE_PIXELS:
            raise OptionError(
                f"{asked}: {self.width} x {self.height} pixels are above {MAX_ADAPTIVE_PIXELS}; "
                "make the picture smaller, or give --supersampling"
            )
        if self.is_adaptive and self.buffer is not None:
            raise OptionError(
                f"buffer, {asked}: {self.buffer} shows the inside of the renderer, which has no "
                "error; give one of the two"
            )
        if self.is_adaptive and self.interpolation == "scanline":
            raise OptionError(
                f"interpolation, {asked}: scanline knows the samples of its own rows alone; give "
                "one of the two"
            )

    @property
    def is_adaptive(self) -> bool:
        """Whether pixels get as many samples as each needs."""
        return self.max_error is not None or self.time_budget is not None

    @property
    def distance(self) -> float | None:
        """From the center of the mesh to the camera in model units; None to fit the picture."""
        return self.view[2] if len(self.view) == 3 else None


def _check_range(name: str, value: int, most: int) -> None:
    if not isinstance(value, int) or not 1 <= value <= most:
        raise OptionError(f"{name}: {value} is out of range; it must be a whole 1 to {most}")

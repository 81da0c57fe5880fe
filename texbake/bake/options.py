"""Every choice of a bake, with its default, written once for the API and the command line."""

from __future__ import annotations

import math
from dataclasses import dataclass

from texbake.errors import OptionError
from texbake.mapping.options.atlas import AtlasOptions
from texbake.mapping.options.texture import MAX_SIZE, TextureOptions

SPACES = ("tangent", "object", "world")
CONVENTIONS = ("opengl", "directx")
RAYS = ("smooth", "vertex", "face")
SHADINGS = ("smooth", "flat")
FILLS = ("none", "push-pull")
SAMPLES = (1, 4, 16, 64)


@dataclass(frozen=True, kw_only=True)
class BakeOptions(TextureOptions):
    """What `bake` does where the caller does not say otherwise.

    Attributes
    ----------
    maps : tuple of str
        Maps to make from the one trace; the names are the keys of `texbake.bake.maps.MAPS`.
    size : int or (int, int)
        Texels a side, or (width, height).
    samples : int
        Rays a texel, a square: 1, 4, 16 or 64, one at the center of each cell of an n x n grid.
    space : str
        Space of normals: `tangent`, `object`, or `world` (the same as object space, since a mesh
        file has no transform of its own left when it is read).
    convention : str
        Green channel of tangent-space normals: `opengl` (+Y up) or `directx` (+Y down).
    bits : int, optional
        Bits a channel of the files: 8, 16 or 32 (float). None: the most the format holds of 16,
        and float for EXR.
    front, back : float, optional
        How far outside the light mesh a ray starts, and how far inside it ends, in model units.
        None: measured from the two meshes.
    rays : str
        Direction of the rays: `smooth` (normals averaged over each position, no gaps), `vertex`
        (the light mesh's shading normals) or `face`.
    high_shading : str
        Normals of the dense mesh: `smooth` (its own if it has any, else angle-weighted) or `flat`.
    cull_back_faces : bool
        Skip surfaces that face away from the ray's start; they are counted either way.
    padding : int
        Texels around each chart filled from the nearest texel of the chart; as many as `unwrap`
        leaves room for.
    fill : str
        What fills the rest: `none` (the map's neutral value) or `push-pull`.
    fail_on_miss : float, optional
        Raise `MissError` if more than this percentage of the texels missed.
    mid, scale : float, optional
        Coding of heights in integer files: d = (h - mid) * scale. None: mid 0.5 and the least
        scale that holds every height.
    keep_hits : bool
        Keep the trace in the result, to make other maps from it later.
    threads : int, optional
        None: every processor.
    """

    maps: tuple[str, ...] = ("normal",)
    samples: int = 1
    space: str = "tangent"
    convention: str = "opengl"
    bits: int | None = None
    front: float | None = None
    back: float | None = None
    rays: str = "smooth"
    high_shading: str = "smooth"
    cull_back_faces: bool = True
    padding: int = AtlasOptions.padding
    fill: str = "none"
    fail_on_miss: float | None = None
    mid: float | None = None
    scale: float | None = None
    keep_hits: bool = False
    threads: int | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.maps or not isinstance(self.maps, tuple):
            raise OptionError("maps: name at least one map to make, in a tuple")
        _check_choice("samples", self.samples, SAMPLES)
        _check_choice("space", self.space, SPACES)
        _check_choice("convention", self.convention, CONVENTIONS)
        _check_choice("bits", self.bits, (None, 8, 16, 32))
        _check_choice("rays", self.rays, RAYS)
        _check_choice("high_shading", self.high_shading, SHADINGS)
        _check_choice("fill", self.fill, FILLS)
        for name in "front", "back":
            distance = getattr(self, name)
            if distance is not None and not (distance >= 0 and math.isfinite(distance)):
                raise OptionError(f"{name}: {distance} is no distance; it must be 0 or more")
        if self.front == 0 and self.back == 0:
            raise OptionError("front, back: both are 0, so that no ray has any length")
        if not (isinstance(self.padding, int) and 0 <= self.padding < MAX_SIZE):
            raise OptionError(
                f"padding: {self.padding} is out of range; it must be 0 to {MAX_SIZE - 1} texels"
            )
        if self.fail_on_miss is not None and not 0 <= self.fail_on_miss <= 100:
            raise OptionError(f"fail-on-miss: {self.fail_on_miss} is no percentage of 0 to 100")
        if self.scale is not None and not (self.scale != 0 and math.isfinite(self.scale)):
            raise OptionError(f"scale: {self.scale} cannot code heights; it must not be 0")
        if self.mid is not None and not math.isfinite(self.mid):
            raise OptionError(f"mid: {self.mid} is not a finite number")
        if self.threads is not None and self.threads < 1:
            raise OptionError(f"threads: {self.threads} is too few; it must be at least 1")

    @property
    def samples_per_side(self) -> int:
        """Samples of a texel along one side."""
        return math.isqrt(self.samples)


def _check_choice(name: str, value: object, choices: tuple[object, ...]) -> None:
    if value not in choices or isinstance(value, float):  # 4.0 equals 4, and is no number of rays
        known = ", ".join(str(choice) for choice in choices if choice is not None)
        raise OptionError(f"{name}: {value} is not one of {known}")

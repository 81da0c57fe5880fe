"""Lights: where their light comes from, and what it is stopped or colored by."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from texbake.errors import OptionError
from texbake.rendering.scene.textures import ImageTexture, Rgb

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

    from texbake.files import PathLike
    from texbake.texture.image import Image

Vector = tuple[float, float, float]
KINDS = ("directional", "point", "spot")
FOG_MODES = ("linear", "exp", "exp2")


def _check_color(name: str, color: Rgb) -> None:
    if len(color) != 3 or not all(0.0 <= channel < math.inf for channel in color):
        raise OptionError(f"{name}: {color} is not three finite numbers of 0 or more")


@dataclass(frozen=True, kw_only=True)
class Shadow:
    """A shadow map: `size` texels a side (of each cube face for a point light).

    `filter_radius` is that of percentage-closer filtering, in texels; 0 compares one texel.
    """

    size: int = 1024
    filter_radius: float = 1.5

    def __post_init__(self) -> None:
        if not 1 <= self.size <= 16384:
            raise OptionError(f"size: {self.size} is out of range; it must be 1 to 16384")
        if not 0.0 <= self.filter_radius <= 16.0:
            raise OptionError(f"filter_radius: {self.filter_radius} texels are not 0 to 16")


@dataclass(frozen=True, kw_only=True, eq=False)
class Light:
    """A light.

    Attributes
    ----------
    kind : str
        `directional` (from infinitely far), `point` or `spot`.
    color, intensity : (r, g, b) linear, float
        Their product is what a white surface that faces a directional light reflects; a point or
        spot light gives that at distance 1, and 1 / d^2 of it at distance d (`decay` 0: everywhere
        the same).
    position : (x, y, z)
        Of point and spot lights; world space.
    direction : (x, y, z)
        That the light goes, of directional and spot lights; any length but 0.
    angle, blend : float
        A spot's whole cone in degrees, and the share of its half angle over which it fades.
    shadow : Shadow, optional
        None: it casts none.
    profile : ImageTexture, optional
        A slide in a spot: its light is multiplied by the picture, upright along `up`.
    static : bool
        Whether light maps are to hold it.
    follows_camera : bool
        Whether `position` and `direction` are right, up and back of the camera instead.
    """

    name: str = "light"
    kind: str = "directional"
    color: Rgb = (1.0, 1.0, 1.0)
    intensity: float = 1.0
    position: Vector = (0.0, 0.0, 0.0)
    direction: Vector = (0.0, -1.0, 0.0)
    up: Vector = (0.0, 1.0, 0.0)
    angle: float = 45.0
    blend: float = 0.15
    decay: float = 2.0
    shadow: Shadow | None = None
    profile: ImageTexture | None = None
    static: bool = True
    follows_camera: bool = False

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise OptionError(f"{self.name}.kind: {self.kind!r} is not one of {', '.join(KINDS)}")
        if not 0.0 < self.angle < 180.0:
            raise OptionError(f"{self.name}.angle: {self.angle} is not above 0 and below 180")
        if not 0.0 <= self.intensity < math.inf:
            raise OptionError(f"{self.name}.intensity: {self.intensity} is not 0 or more")
        _check_color(f"{self.name}.color", self.color)
        if not 0.0 <= self.blend <= 1.0:
            raise OptionError(f"{self.name}.blend: {self.blend} is not from 0 to 1")
        if not 0.0 <= self.decay < math.inf:
            raise OptionError(f"{self.name}.decay: {self.decay} is not 0 or more")
        if not all(map(math.isfinite, (*self.position, *self.up))):
            raise OptionError(f"{self.name}.position: it and up must be finite")
        if self.kind != "point" and not 0.0 < math.hypot(*self.direction) < math.inf:
            raise OptionError(f"{self.name}.direction: {self.direction} points nowhere")


@dataclass(frozen=True, kw_only=True)
class Ambient:
    """Light from everywhere: `color` from above, `ground` from below (None: the same)."""

    color: Rgb = (0.0, 0.0, 0.0)
    ground: Rgb | None = None

    def __post_init__(self) -> None:
        _check_color("ambient.color", self.color)
        if self.ground is not None:
            _check_color("ambient.ground", self.ground)


@dataclass(frozen=True, kw_only=True, eq=False)
class Environment:
    """What lies infinitely far around the scene.

    `image` is latitude-longitude (2:1) or the six faces +x, -x, +y, -y, +z, -z; `color` stands for
    it where there is none. `rotate` turns it about the up axis, in degrees.
    """

    image: PathLike | Image | npt.NDArray[np.float32] | None = None
    faces: tuple[PathLike | Image | npt.NDArray[np.float32], ...] = ()
    color: Rgb = (0.0, 0.0, 0.0)
    intensity: float = 1.0
    rotate: float = 0.0
    background: bool = True
    lighting: bool = False
    size: int = 512

    def __post_init__(self) -> None:
        if self.image is not None and self.faces:
            raise OptionError("faces: the image says it already; give one of them")
        _check_color("environment.color", self.color)
        if len(self.faces) not in (0, 6):
            raise OptionError(f"faces: {len(self.faces)} are not six: +x, -x, +y, -y, +z, -z")
        if not 0.0 <= self.intensity < math.inf:
            raise OptionError(f"intensity: {self.intensity} is not 0 or more")
        if not math.isfinite(self.rotate):
            raise OptionError(f"rotate: {self.rotate} is not finite")
        if not 1 <= self.size <= 8192:
            raise OptionError(f"size: {self.size} is out of range; it must be 1 to 8192")


@dataclass(frozen=True, kw_only=True)
class Fog:
    """What light fades into over distance: `linear` from start to end, `exp` or `exp2`."""

    color: Rgb = (0.5, 0.55, 0.6)
    mode: str = "exp"
    density: float = 0.1
    start: float = 0.0
    end: float = 10.0

    def __post_init__(self) -> None:
        _check_color("fog.color", self.color)
        if self.mode not in FOG_MODES:
            raise OptionError(f"fog.mode: {self.mode!r} is not one of {', '.join(FOG_MODES)}")
        if not 0.0 <= self.density < math.inf:
            raise OptionError(f"fog.density: {self.density} is not 0 or more")
        if not (math.isfinite(self.start) and self.start < self.end < math.inf):
            raise OptionError(f"fog.end: {self.end} is not beyond the start, {self.start}")

    @property
    def fades(self) -> bool:
        """Whether there is any: not where its density is 0."""
        return self.mode == "linear" or self.density > 0.0


@dataclass(frozen=True, kw_only=True)
class AmbientOcclusion:
    """Ambient light that nearby surfaces in the picture hide: within `radius` in model units."""

    radius: float | None = None
    samples: int = 16
    strength: float = 1.0

    def __post_init__(self) -> None:
        if self.radius is not None and not 0.0 < self.radius < math.inf:
            raise OptionError(f"radius: {self.radius} is not above 0")
        if not 1 <= self.samples <= 1024:
            raise OptionError(f"samples: {self.samples} is out of range; it must be 1 to 1024")
        if not 0.0 <= self.strength <= 1.0:
            raise OptionError(f"strength: {self.strength} is not from 0 to 1")


@dataclass(frozen=True, kw_only=True, eq=False)
class Lighting:
    """All light of a scene."""

    lights: tuple[Light, ...] = ()
    ambient: Ambient = field(default_factory=Ambient)
    environment: Environment | None = None
    occlusion: AmbientOcclusion | None = None
    fog: Fog | None = None

"""Lights of a scene: lamps with shadows and cookies, ambient light, environment and fog."""

from __future__ import annotations

import math
from dataclasses import field
from typing import TYPE_CHECKING

from texbake.errors import OptionError
from texbake.records import dataclass
from texbake.rendering.scene.textures import ImageTexture, Rgb
from texbake.schema import check_fields, option

if TYPE_CHECKING:
    from texbake.files import PathLike
    from texbake.mesh.mesh import Float32Array
    from texbake.texture.image import Image

Vector = tuple[float, float, float]
KINDS = ("directional", "point", "spot")
GATES = ("rectangle", "round")
FOG_MODES = ("linear", "exp", "exp2")


def _check_color(name: str, color: Rgb) -> None:
    if len(color) != 3 or not all(0.0 <= channel < math.inf for channel in color):
        raise OptionError(f"{name}: {color} is not three finite numbers of 0 or more")


@dataclass(frozen=True, kw_only=True)
class Shadow:
    """A shadow map with `size` texels per side (of each cube face for a point light).

    `filter_radius` is that of percentage-closer filtering, in texels; 0 compares one texel.
    """

    size: int = option(
        1024,
        "Width of the shadow map in texels; for a point light, of each cube face.",
        low=1,
        high=16384,
    )
    filter_radius: float = option(
        1.5, "Radius in texels of percentage-closer filtering; 0 gives hard edges.", low=0, high=16
    )

    def __post_init__(self) -> None:
        check_fields(self)


@dataclass(frozen=True, kw_only=True, eq=False)
class Light:
    """A light."""

    name: str = option("light", "Name of the light in messages and in the plan.")
    kind: str = option(
        "directional",
        "Light from infinitely far (directional), from a point, or in a cone (spot).",
        choices=KINDS,
    )
    color: Rgb = option((1.0, 1.0, 1.0), "Linear color of the light.")
    intensity: float = option(
        1.0, "Factor of the color; point and spot lights have it at distance 1.", low=0
    )
    position: Vector = option((0.0, 0.0, 0.0), "Position of a point or spot light in world space.")
    direction: Vector = option(
        (0.0, -1.0, 0.0), "Direction in which a directional or spot light shines."
    )
    up: Vector = option((0.0, 1.0, 0.0), "Direction that is up in the profile of a spot light.")
    angle: float = option(
        45.0, "Angle of the whole cone of a spot light in degrees.", above=0, below=180
    )
    blend: float = option(
        0.15, "Share of the half angle over which a spot light fades out.", low=0, high=1
    )
    decay: float = option(
        2.0, "Power of the distance by which a point or spot light fades; 0 for none.", low=0
    )
    shadow: Shadow | None = option(
        None, "Shadow map of the light; without it the light casts no shadows."
    )
    profile: ImageTexture | None = option(
        None, "Image that a spot light projects: its cookie (gobo)."
    )
    gate: str = option(
        "rectangle",
        "Opening around the profile: its own rectangle, whose longer side fills the angle, or "
        "the round cone, which its shorter side fills.",
        choices=GATES,
    )
    aspect: float | None = option(
        None, "Width of the profile divided by its height; without it that of the image.", above=0
    )
    static: bool = option(True, "Whether light maps contain the light.")
    follows_camera: bool = option(
        False, "Whether x, y and z of position and direction are right, up and back of the camera."
    )

    @property
    def shines(self) -> bool:
        """Whether it is not dark."""
        return self.intensity > 0.0 and any(self.color)

    def __post_init__(self) -> None:
        check_fields(self, prefix=f"{self.name}.")
        _check_color(f"{self.name}.color", self.color)
        if not all(map(math.isfinite, (*self.position, *self.up))):
            raise OptionError(f"{self.name}.position: it and up must be finite")
        squared = sum(x * x for x in self.direction)
        if self.kind != "point" and not 0.0 < squared < math.inf:
            raise OptionError(f"{self.name}.direction: {self.direction} is not a direction")


@dataclass(frozen=True, kw_only=True)
class Ambient:
    """Light from everywhere: `color` from above, `ground` from below (None: the same)."""

    color: Rgb = option((0.0, 0.0, 0.0), "Linear color of ambient light from above.")
    ground: Rgb | None = option(
        None, "Linear color of ambient light from below; without it the same as from above."
    )

    @property
    def shines(self) -> bool:
        """Whether it is not dark."""
        return any(self.color) or any(self.ground or ())

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

    image: PathLike | Image | Float32Array | None = option(
        None,
        "Latitude-longitude image, twice as wide as high, or studio for a room with soft lamps.",
    )
    faces: tuple[PathLike | Image | Float32Array, ...] = option(
        (), "Six images of a cube map: +x, -x, +y, -y, +z, -z."
    )
    color: Rgb = option((0.0, 0.0, 0.0), "Linear color of an environment without an image.")
    intensity: float = option(1.0, "Factor of the environment's light.", low=0)
    rotate: float = option(
        0.0, "Angle in degrees by which the environment is turned about the up axis."
    )
    background: bool = option(True, "Whether the environment is seen behind the objects.")
    lighting: bool = option(False, "Whether the environment lights the objects.")
    size: int = option(512, "Width in texels of each face of its cube map.", low=1, high=8192)

    def __post_init__(self) -> None:
        check_fields(self)
        if self.image is not None and self.faces:
            raise OptionError("faces: it conflicts with the image; give only one")
        _check_color("environment.color", self.color)
        if len(self.faces) not in (0, 6):
            raise OptionError(f"faces: {len(self.faces)} are not six: +x, -x, +y, -y, +z, -z")


@dataclass(frozen=True, kw_only=True)
class Fog:
    """What light fades into over distance: `linear` from start to end, `exp` or `exp2`."""

    color: Rgb = option((0.5, 0.55, 0.6), "Linear color that distant light fades into.")
    mode: str = option(
        "exp",
        "How fog grows with distance: linear from start to end, exp or exp2.",
        choices=FOG_MODES,
    )
    density: float = option(0.1, "Density of exponential fog per world unit.", low=0)
    start: float = option(0.0, "Distance at which linear fog begins.")
    end: float = option(10.0, "Distance at which linear fog hides everything.")

    def __post_init__(self) -> None:
        check_fields(self, prefix="fog.")
        _check_color("fog.color", self.color)
        if not self.start < self.end:
            raise OptionError(f"fog.end: {self.end} is not beyond the start, {self.start}")

    @property
    def fades(self) -> bool:
        """Whether the fog has any effect: False if its density is 0."""
        return self.mode == "linear" or self.density > 0.0


@dataclass(frozen=True, kw_only=True)
class AmbientOcclusion:
    """Ambient light that nearby surfaces in the picture hide: within `radius` in model units."""

    radius: float | None = option(
        None,
        "Distance within which surfaces occlude one another; without it, by scene size.",
        above=0,
    )
    samples: int = option(16, "Samples per pixel.", low=1, high=1024)
    strength: float = option(
        1.0, "Share of the occlusion that is applied, from 0 to 1.", low=0, high=1
    )

    def __post_init__(self) -> None:
        check_fields(self)


@dataclass(frozen=True, kw_only=True, eq=False)
class Lighting:
    """All light of a scene."""

    lights: tuple[Light, ...] = ()
    ambient: Ambient = field(default_factory=Ambient)
    environment: Environment | None = None
    occlusion: AmbientOcclusion | None = None
    fog: Fog | None = None

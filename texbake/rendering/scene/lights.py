"""Lights of a scene: lamps with shadows and cookies, ambient light, environment and fog."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated

from texbake.errors import OptionError
from texbake.rendering.scene.textures import ImageTexture, Rgb
from texbake.schema import Option, check_fields

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

    from texbake.files import PathLike
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

    size: Annotated[
        int,
        Option(
            "Width of the shadow map in texels; for a point light, of each cube face.",
            low=1,
            high=16384,
        ),
    ] = 1024
    filter_radius: Annotated[
        float,
        Option(
            "Radius in texels of percentage-closer filtering; 0 gives hard edges.", low=0, high=16
        ),
    ] = 1.5

    def __post_init__(self) -> None:
        check_fields(self)


@dataclass(frozen=True, kw_only=True, eq=False)
class Light:
    """A light."""

    name: Annotated[str, Option("Name of the light in messages and in the plan.")] = "light"
    kind: Annotated[
        str,
        Option(
            "Light from infinitely far (directional), from a point, or in a cone (spot).",
            choices=KINDS,
        ),
    ] = "directional"
    color: Annotated[Rgb, Option("Linear color of the light.")] = (1.0, 1.0, 1.0)
    intensity: Annotated[
        float, Option("Factor of the color; point and spot lights have it at distance 1.", low=0)
    ] = 1.0
    position: Annotated[Vector, Option("Position of a point or spot light in world space.")] = (
        0.0,
        0.0,
        0.0,
    )
    direction: Annotated[
        Vector, Option("Direction in which a directional or spot light shines.")
    ] = (0.0, -1.0, 0.0)
    up: Annotated[Vector, Option("Direction that is up in the profile of a spot light.")] = (
        0.0,
        1.0,
        0.0,
    )
    angle: Annotated[
        float, Option("Angle of the whole cone of a spot light in degrees.", above=0, below=180)
    ] = 45.0
    blend: Annotated[
        float, Option("Share of the half angle over which a spot light fades out.", low=0, high=1)
    ] = 0.15
    decay: Annotated[
        float,
        Option("Power of the distance by which a point or spot light fades; 0 for none.", low=0),
    ] = 2.0
    shadow: Annotated[
        Shadow | None, Option("Shadow map of the light; without it the light casts no shadows.")
    ] = None
    profile: Annotated[
        ImageTexture | None, Option("Image that a spot light projects: its cookie (gobo).")
    ] = None
    gate: Annotated[
        str,
        Option(
            "Opening around the profile: its own rectangle, whose longer side fills the angle, or "
            "the round cone, which its shorter side fills.",
            choices=GATES,
        ),
    ] = "rectangle"
    aspect: Annotated[
        float | None,
        Option(
            "Width of the profile divided by its height; without it that of the image.", above=0
        ),
    ] = None
    static: Annotated[bool, Option("Whether light maps contain the light.")] = True
    follows_camera: Annotated[
        bool,
        Option(
            "Whether x, y and z of position and direction are right, up and back of the camera."
        ),
    ] = False

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

    color: Annotated[Rgb, Option("Linear color of ambient light from above.")] = (0.0, 0.0, 0.0)
    ground: Annotated[
        Rgb | None,
        Option("Linear color of ambient light from below; without it the same as from above."),
    ] = None

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

    image: Annotated[
        PathLike | Image | npt.NDArray[np.float32] | None,
        Option(
            "Latitude-longitude image, twice as wide as high, or studio for a room with soft lamps."
        ),
    ] = None
    faces: Annotated[
        tuple[PathLike | Image | npt.NDArray[np.float32], ...],
        Option("Six images of a cube map: +x, -x, +y, -y, +z, -z."),
    ] = ()
    color: Annotated[Rgb, Option("Linear color of an environment without an image.")] = (
        0.0,
        0.0,
        0.0,
    )
    intensity: Annotated[float, Option("Factor of the environment's light.", low=0)] = 1.0
    rotate: Annotated[
        float, Option("Angle in degrees by which the environment is turned about the up axis.")
    ] = 0.0
    background: Annotated[bool, Option("Whether the environment is seen behind the objects.")] = (
        True
    )
    lighting: Annotated[bool, Option("Whether the environment lights the objects.")] = False
    size: Annotated[
        int, Option("Width in texels of each face of its cube map.", low=1, high=8192)
    ] = 512

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

    color: Annotated[Rgb, Option("Linear color that distant light fades into.")] = (0.5, 0.55, 0.6)
    mode: Annotated[
        str,
        Option(
            "How fog grows with distance: linear from start to end, exp or exp2.", choices=FOG_MODES
        ),
    ] = "exp"
    density: Annotated[float, Option("Density of exponential fog per world unit.", low=0)] = 0.1
    start: Annotated[float, Option("Distance at which linear fog begins.")] = 0.0
    end: Annotated[float, Option("Distance at which linear fog hides everything.")] = 10.0

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

    radius: Annotated[
        float | None,
        Option(
            "Distance within which surfaces occlude one another; without it, by scene size.",
            above=0,
        ),
    ] = None
    samples: Annotated[int, Option("Samples per pixel.", low=1, high=1024)] = 16
    strength: Annotated[
        float, Option("Share of the occlusion that is applied, from 0 to 1.", low=0, high=1)
    ] = 1.0

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

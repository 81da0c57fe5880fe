"""Every option of a picture, with its default."""

from __future__ import annotations

from texbake.errors import OptionError
from texbake.limits import parse_seconds
from texbake.records import dataclass
from texbake.rendering.scene.textures import FILTERS
from texbake.sampling.bounds import parse_picture_bound
from texbake.schema import CheckedOptions, option

MAX_SIZE = 16384  # pixels per side
MAX_SUPERSAMPLING = 16
# Visibility and shading keep about 50 bytes per sample, so this is about 13 GB.
MAX_SAMPLES = 2**28
# Sums and estimates of adaptive samples keep about 100 bytes per pixel: about 7 GB.
MAX_ADAPTIVE_PIXELS = 2**26
BACK_FACES = ("cull", "show")
UPS = ("y", "z")
INTERPOLATIONS = ("perspective", "affine", "scanline")
EDGES = ("multisample", "supersample")
MAPPING_ORDERS = ("screen", "texture", "texture-coverage")
EXPOSURES = ("auto", "none")
BUFFERS = ("depth", "normals", "uv", "mip-level", "overdraw", "object-id", "texel-grid")
MAX_BOUNCES = 4
Rgb = tuple[float, float, float]
ViewAngles = tuple[float, float] | tuple[float, float, float | None]


@dataclass(frozen=True, kw_only=True)
class RenderOptions(CheckedOptions):
    """How `render` and `compare` draw a picture.

    Azimuth 0 looks at the front of the mesh (from +z, or from -y where z is up) and grows
    counter-clockwise as seen from above; without a distance the whole mesh fits into the picture.
    With a `max_error` every sample is shaded, and pixels get up to 341 samples; `edges` has no
    effect then, and `supersampling` only on shadow maps and ambient occlusion. Colors are
    sRGB-coded, from 0 to 1.
    """

    width: int = option(
        1280, "Width of the picture.", metavar="PX", low=1, high=MAX_SIZE, unit="pixels"
    )
    height: int = option(
        720, "Height of the picture.", metavar="PX", low=1, high=MAX_SIZE, unit="pixels"
    )
    view: ViewAngles = option(
        (30.0, 20.0),
        "Azimuth and elevation of the camera in degrees, and its distance from the center in "
        "model units.",
        metavar="AZ,EL[,DIST]",
    )
    up: str = option("y", "Axis of the world that is up in the picture.", choices=UPS)
    fov: float = option(
        35.0, "Vertical field of view.", metavar="DEG", above=0, below=180, unit="degrees"
    )
    supersampling: int = option(
        2,
        "Samples per pixel along one side, N x N in all.",
        metavar="N",
        low=1,
        high=MAX_SUPERSAMPLING,
    )
    max_error: str | float | None = option(
        None,
        "Add samples until the estimated error of every pixel is at most this share of the "
        "way from black to white in sRGB: 2/255, or 0.01.",
        metavar="E",
        default="the same number of samples everywhere",
    )
    time_budget: str | float | None = option(
        None,
        "Time that the picture may take, such as 20s or 2min: pixels are refined until it is "
        "spent. The report names the `max_error` that gives the same picture.",
        metavar="T",
        default="no limit",
    )
    background: Rgb | None = option(
        (0.15, 0.16, 0.18), "Color behind the mesh.", low=0, high=1, default="transparent"
    )
    base_color: Rgb = option(
        (0.8, 0.8, 0.8), "Color of the mesh where it has no albedo texture.", low=0, high=1
    )
    exposure: str | None = option(
        None,
        "Darken pictures that are too bright and roll off highlights (auto), or clip light at "
        "white (none).",
        choices=EXPOSURES,
        default="auto in texbake's built-in light, none in a scene's own",
    )
    back_faces: str | None = option(
        None,
        "Leave out triangles seen from behind (cull), or draw them with their normals turned "
        "to the camera (show).",
        choices=BACK_FACES,
        default="show in pictures of an open or inside-out mesh, cull in scenes",
    )
    edges: str = option(
        "multisample",
        "Shade a pixel inside a triangle once (multisample), or shade every sample (supersample).",
        choices=EDGES,
    )
    interpolation: str = option(
        "perspective",
        "Interpolate with perspective correction, without it (affine), or step by step along "
        "edges and spans (scanline).",
        choices=INTERPOLATIONS,
    )
    filter: str | None = option(
        None, "Filter of all image textures.", choices=FILTERS, default="each texture's own"
    )
    buffer: str | None = option(
        None,
        "Show a buffer of the renderer in place of the picture.",
        choices=BUFFERS,
        default="the picture",
    )
    mapping_order: str = option(
        "screen",
        "Look up the texture for each pixel (screen), write each texel at a pixel (texture), "
        "or spread it over the pixels that it covers (texture-coverage). In texture order only "
        "base colors are shown, with one sample per pixel.",
        choices=MAPPING_ORDERS,
    )
    bounces: int = option(
        1,
        "Number of reflections within reflections, for environments rendered from the scene.",
        metavar="N",
        low=0,
        high=MAX_BOUNCES,
    )
    max_triangles: int = option(
        4_000_000,
        "Greatest number of triangles that displacement may divide a mesh into.",
        metavar="N",
        low=1,
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        n_samples = self.width * self.height * self.supersampling**2
        if n_samples > MAX_SAMPLES:
            raise OptionError(
                f"supersampling: {self.width} x {self.height} pixels of {self.supersampling**2} "
                f"samples are {n_samples} samples, above {MAX_SAMPLES}; make one of them smaller"
            )
        if self.distance is not None and not self.distance > 0:
            raise OptionError(f"view: the distance {self.distance} must be above 0")
        self._check_targets()

    def _check_targets(self) -> None:
        """Raise `OptionError` for an error or a time that cannot be."""
        if self.max_error is not None:
            parse_picture_bound(self.max_error)
        if self.time_budget is not None:
            parse_seconds(self.time_budget)
        asked = "max_error" if self.max_error is not None else "time_budget"
        if self.is_adaptive and self.width * self.height > MAX_ADAPTIVE_PIXELS:
            raise OptionError(
                f"{asked}: {self.width} x {self.height} pixels are above {MAX_ADAPTIVE_PIXELS}; "
                "make the picture smaller, or give `supersampling`"
            )
        if self.mapping_order != "screen" and (self.is_adaptive or self.buffer is not None):
            other = asked if self.is_adaptive else "buffer"
            raise OptionError(
                f"mapping_order, {other}: texels are not samples of a pixel; give one of the two"
            )
        if self.is_adaptive and self.buffer is not None:
            raise OptionError(
                f"buffer, {asked}: {self.buffer} is a buffer of the renderer, which has no "
                "error; give one of the two"
            )
        if self.is_adaptive and self.interpolation == "scanline":
            raise OptionError(
                f"interpolation, {asked}: scanline draws the samples of whole rows only; "
                "give one of the two"
            )

    @property
    def is_adaptive(self) -> bool:
        """Whether pixels get as many samples as each needs."""
        return self.max_error is not None or self.time_budget is not None

    @property
    def exposes(self) -> bool:
        """Whether the picture is exposed; pictures of buffers and of textures alone never are."""
        shows_light = self.buffer is None and self.mapping_order == "screen"
        return self.exposure == "auto" and shows_light

    @property
    def distance(self) -> float | None:
        """From the center of the mesh to the camera in model units; None to fit the picture."""
        return self.view[2] if len(self.view) == 3 else None

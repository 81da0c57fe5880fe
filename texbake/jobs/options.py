"""Every choice of the whole job and of the demo, with its default, written once."""

from __future__ import annotations

from dataclasses import dataclass

from texbake.baking.options import BakeOptions
from texbake.errors import OptionError
from texbake.mapping.options import UnwrapOptions
from texbake.mesh.simplify_options import DEFAULT_QUALITY, MIN_FACES, QUALITIES
from texbake.rendering.options import RenderOptions, Rgb

View = tuple[float, float] | tuple[float, float, float | None]

DEMO_FOLDER = "texbake_demo"
DEFAULT_SAMPLES = 4  # rays a texel where nothing else is asked for
MIN_TRIANGLES = 1000  # an orange of fewer has no pores
_PICTURE_SIZE = 720  # pixels a side of each picture


@dataclass(frozen=True, kw_only=True)
class RunOptions:
    """What `run` does where the caller does not say otherwise.

    Attributes
    ----------
    n_faces : int
        Triangles of the light mesh, at most.
    quality : str
        How the mesh is made lighter: `fast`, or `best` for better and slower.
    size : int or (int, int)
        Texels of the maps, a side, or (width, height).
    padding : int
        Texels around each chart that repeat its edge; the atlas leaves room for them.
    samples : int or str, optional
        Rays a texel: 1, 4, 16, 64, or `adaptive`. None: 4, or adaptive where an error or a time is
        asked for.
    max_error, time_budget : optional
        Of the maps; as in `BakeOptions`.
    convention : str
        Green channel of the normal map: `opengl` or `directx`. That inside the GLB file is always
        OpenGL, because glTF asks for it.
    view : (azimuth, elevation) or (azimuth, elevation, distance)
        Of the pictures; see `RenderOptions`.
    up : str
        The axis of the world that is up in the pictures: `y` or `z`.
    base_color : (r, g, b)
        Of the mesh in the pictures and in the GLB file, sRGB-coded in [0, 1].
    threads : int, optional
        None: every processor.
    """

    n_faces: int = 500
    quality: str = DEFAULT_QUALITY
    size: int | tuple[int, int] = 2048
    padding: int = 8
    samples: int | str | None = None
    max_error: str | None = None
    time_budget: str | float | None = None
    convention: str = "opengl"
    view: View = RenderOptions.view
    up: str = RenderOptions.up
    base_color: Rgb = RenderOptions.base_color
    threads: int | None = None

    def __post_init__(self) -> None:
        if self.n_faces < MIN_FACES:
            raise OptionError(f"faces: {self.n_faces} is too few; it must be at least {MIN_FACES}")
        if self.quality not in QUALITIES:
            raise OptionError(f"quality: {self.quality} is not one of {', '.join(QUALITIES)}")
        # These check their values, now and not when half of the work is done.
        self.unwrap_options()
        self.bake_options()
        self.render_options()

    def unwrap_options(self) -> UnwrapOptions:
        """Return how the light mesh gets its texture coordinates."""
        return UnwrapOptions(size=self.size, padding=self.padding)

    def bake_options(self) -> BakeOptions:
        """Return how the maps are baked."""
        return BakeOptions(
            maps=("normal", "displacement"),
            size=self.size,
            padding=self.padding,
            samples=self._bake_samples,
            max_error=self.max_error,
            time_budget=self.time_budget,
            convention=self.convention,
            fill="push-pull",
            threads=self.threads,
        )

    @property
    def _bake_samples(self) -> int | str:
        if self.samples is not None:
            return self.samples
        asked = self.max_error is not None or self.time_budget is not None
        return BakeOptions.samples if asked else DEFAULT_SAMPLES

    def render_options(self) -> RenderOptions:
        """Return how the pictures are made."""
        return RenderOptions(
            width=_PICTURE_SIZE,
            height=_PICTURE_SIZE,
            view=self.view,
            up=self.up,
            base_color=self.base_color,
        )


@dataclass(frozen=True, kw_only=True)
class DemoOptions:
    """What `demo` does where the caller does not say otherwise.

    Attributes
    ----------
    triangles : int
        Of the dense mesh, about.
    faces : int
        Triangles of the light mesh.
    size : int or (int, int)
        Texels of the maps.
    threads : int, optional
        None: every processor.
    """

    triangles: int = 1_000_000
    faces: int = RunOptions.n_faces
    size: int | tuple[int, int] = RunOptions.size
    threads: int | None = None

    def __post_init__(self) -> None:
        if self.triangles < MIN_TRIANGLES:
            raise OptionError(
                f"triangles: {self.triangles} is too few; it must be at least {MIN_TRIANGLES}"
            )
        self.run_options()

    def run_options(self) -> RunOptions:
        """Return how the whole job is done."""
        return RunOptions(
            n_faces=self.faces,
            size=self.size,
            view=(30.0, 32.0),  # down on the stem
            base_color=(0.94, 0.55, 0.16),
            threads=self.threads,
        )

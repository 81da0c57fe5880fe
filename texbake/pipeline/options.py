"""Every choice of the whole job and of the demo, with its default, written once."""

from __future__ import annotations

from dataclasses import dataclass

from texbake.bake.options import BakeOptions
from texbake.errors import OptionError
from texbake.mapping.options import UnwrapOptions
from texbake.mesh.simplify_options import QUALITIES
from texbake.render.options import RenderOptions

MIN_FACES = 4  # a tetrahedron


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
    samples : int
        Rays a texel: 1, 4, 16 or 64.
    convention : str
        Green channel of the normal map's file: `opengl` or `directx`. The GLB file always carries
        an OpenGL map, because glTF asks for it.
    up : str
        The axis of the world that is up in the pictures: `y` or `z`.
    threads : int, optional
        None: every processor.
    """

    n_faces: int = 500
    quality: str = "fast"
    size: int | tuple[int, int] = 2048
    padding: int = 8
    samples: int = 4
    convention: str = "opengl"
    up: str = "y"
    threads: int | None = None

    def __post_init__(self) -> None:
        if self.n_faces < MIN_FACES:
            raise OptionError(f"faces: {self.n_faces} is too few; it must be at least {MIN_FACES}")
        if self.quality not in QUALITIES:
            raise OptionError(f"quality: {self.quality} is not one of {', '.join(QUALITIES)}")
        # Making the others' options checks their values now, before any work is done.
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
            samples=self.samples,
            convention=self.convention,
            fill="push-pull",
            threads=self.threads,
        )

    def render_options(self) -> RenderOptions:
        """Return how the pictures are made."""
        return RenderOptions(width=PANEL_SIZE, height=PANEL_SIZE, up=self.up)

"""Every option of `bake`, with its default, without loading NumPy."""

from __future__ import annotations

import math
from typing import Annotated

from texbake.baking.maps import MAP_NAMES
from texbake.baking.memory import (
    MOST_CHUNKS,
    STREAMED_CHUNKS,
    STREAMED_FACE,
    TREE_FACE,
    bake_memory,
    memory_left,
    parse_bytes,
)
from texbake.errors import OptionError, quoted
from texbake.limits import parse_seconds
from texbake.mapping.options import DEFAULT_PADDING
from texbake.mapping.options.shared import MAX_SIZE, TextureOptions
from texbake.mesh.options import DEFAULT_ORIENTATION, ORIENTATION_OPTION
from texbake.records import dataclass
from texbake.sampling.bounds import DEFAULT_MAX_ERROR, ErrorBounds, parse_bounds
from texbake.schema import THREADS_OPTION, CheckedOptions, Option, option

SPACES = ("tangent", "object", "world")
CONVENTIONS = ("opengl", "directx")
RAYS = ("smooth", "vertex", "face")
SHADINGS = ("smooth", "flat")
FILLS = ("none", "push-pull")
ON_MISS = ("neutral", "closest")
VERTEX_COLORS = ("auto", "linear", "srgb")
_SRGB_FILES = (".ply", ".obj", ".off", ".fbx", ".dae", ".zae", ".3mf", ".3dxml", ".xaml")
SAMPLES = (1, 4, 16, 64)
ADAPTIVE = "adaptive"
BITS = (8, 16, 32)

BITS_OPTION = Option(
    "Bits per channel; 32 is floating point.",
    choices=BITS,
    default="the most that the file format holds; integers have at most 16",
)
PADDING_OPTION = Option(
    "Width of the padding around each chart, filled with the nearest texels of the chart.",
    metavar="PX",
    low=0,
    high=MAX_SIZE - 1,
    unit="texels",
)
CONVENTION_OPTION = Option(
    "Green channel of normal maps: +Y up (opengl) or +Y down (directx).", choices=CONVENTIONS
)
MAX_RAYS = 4096  # secondary rays per texel
MEASURED = "fitted at each vertex"


@dataclass(frozen=True, kw_only=True)
class SecondaryOptions(CheckedOptions):
    """How ambient occlusion, bent normals and thickness are sampled.

    Noise falls with about the 3/4th power of the number of rays.
    """

    secondary_rays: int = option(
        64,
        f"Rays per texel for ao, bent-normal and thickness, a power of two up to {MAX_RAYS}. "
        "They are spread over the samples of the texel, at least one for each.",
        metavar="N",
        low=1,
        high=MAX_RAYS,
    )
    denoise: bool = option(
        True,
        "Average each texel of ao and thickness with neighbors in its chart that differ by no "
        "more than the noise of their rays, or keep the raw values.",
        flag="--denoise/--no-denoise",
    )
    occluder_distance: float | None = option(
        None,
        "Distance beyond which surfaces no longer occlude, for ao and bent-normal.",
        metavar="D",
        above=0,
        unit="model units",
        default="unlimited",
    )
    thickness_distance: float | None = option(
        None,
        "Thickness that becomes white in integer files, and length of the rays that measure it.",
        metavar="D",
        above=0,
        unit="model units",
        default="the greatest of the map",
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        n = self.secondary_rays
        if n & (n - 1) != 0:
            raise OptionError(
                f"secondary_rays: {quoted(n)} is not a power of two; use 64, or 256 for less noise"
            )


@dataclass(frozen=True, kw_only=True)
class BakeOptions(SecondaryOptions, TextureOptions):
    """How `bake` makes maps of a high-poly mesh for a low-poly mesh.

    Samples of a texel lie at the centers of the cells of a square grid. The space `world` is the
    same as `object`, because a mesh that has been read has no transform of its own. Rays along
    `smooth` normals, averaged at each position, leave no gaps; those along `vertex` normals follow
    the low-poly mesh's shading. Heights are coded in integer files as d = (h - mid) * scale.
    """

    maps: tuple[str, ...] = option(
        ("normal",), "Maps to bake, all with the same rays.", choices=MAP_NAMES, metavar="NAME,..."
    )
    samples: int | str = option(
        1,
        "Rays per texel, averaged; adaptive casts up to 64 where neighboring samples differ.",
        choices=(*SAMPLES, ADAPTIVE),
    )
    max_error: str | None = option(
        None,
        "Add samples until the estimated error of every texel is at most this: 0.5deg for "
        "normals, 0.001 (model units) or 0.01% (of the diagonal) for heights, or 0.5deg,0.001.",
        metavar="E",
        default=f"{DEFAULT_MAX_ERROR} where samples are adaptive",
    )
    time_budget: str | float | None = option(
        None,
        "Time that the bake may take, such as 20s or 2min: texels are refined until it is "
        "spent. The report names the `max_error` that gives the same maps.",
        metavar="T",
        default="no limit",
    )
    space: str = option("tangent", "Space of the normals.", choices=SPACES)
    convention: Annotated[str, CONVENTION_OPTION] = "opengl"
    bits: Annotated[int | None, BITS_OPTION] = None
    front: float | None = option(
        None,
        "Distance outside the low-poly mesh at which rays start.",
        metavar="D",
        low=0,
        unit="model units",
        default=MEASURED,
    )
    back: float | None = option(
        None,
        "Distance inside the low-poly mesh at which rays end.",
        metavar="D",
        low=0,
        unit="model units",
        default=MEASURED,
    )
    max_reach: float | None = option(
        None,
        "Keep rays from parts that the low-poly mesh lacks: measured distances, but not a "
        "given `front` or `back`, are at most this.",
        metavar="D",
        above=0,
        unit="model units",
        default="as far as the meshes are apart",
    )
    rays: str = option(
        "smooth",
        "Direction of the rays: along averaged normals, which leave no gaps at hard edges "
        "(smooth), the low-poly mesh's vertex normals, or its face normals.",
        choices=RAYS,
    )
    orientation: Annotated[str, ORIENTATION_OPTION] = DEFAULT_ORIENTATION
    high_shading: str = option(
        "smooth",
        "Normals of the high-poly mesh: its vertex normals (smooth) or its face normals (flat).",
        choices=SHADINGS,
    )
    high_normal_maps: bool = option(
        True,
        "Take the normals of the high-poly mesh from its own normal maps, where it has any.",
        flag="--high-normal-maps/--no-high-normal-maps",
    )
    cull_back_faces: bool = option(
        True,
        "Let rays pass through surfaces that face away from them, or hit those as well.",
        flag="--cull-back-faces/--hit-back-faces",
    )
    padding: Annotated[int, PADDING_OPTION] = DEFAULT_PADDING
    fill: str = option(
        "none",
        "Fill the rest of a map with its neutral value (none), or smoothly with the colors "
        "around it (push-pull).",
        choices=FILLS,
    )
    on_miss: str = option(
        "neutral",
        "Where a ray misses the high-poly mesh, leave the neutral value, or take the closest "
        "point of a face that faces the ray.",
        choices=ON_MISS,
    )
    fail_on_miss: float | None = option(
        None,
        "Fail and write nothing if more than this percentage of the texels missed the "
        "high-poly mesh.",
        metavar="PERCENT",
        low=0,
        high=100,
        unit="percent",
        default="misses are only reported",
    )
    bake_island: tuple[str, ...] = option(
        (),
        "Where texture islands are stacked, bake the one with this face, or those of this "
        "group; repeatable.",
        metavar="FACE|GROUP",
        many=True,
        default="the first in the UV tile",
    )
    mid: float | None = option(
        None, "Value of height 0 in an integer file, from 0 to 1.", metavar="M", default="0.5"
    )
    scale: float | None = option(
        None,
        "Difference in height between black and white in an integer file.",
        metavar="S",
        unit="model units",
        default="the least that holds every height",
    )
    curvature_scale: float | None = option(
        None,
        "Curvature that becomes white in integer files, as 1 / radius in model units.",
        metavar="K",
        above=0,
        default="99 % of the texels have less",
    )
    vertex_colors: str = option(
        "auto",
        "Color space of the vertex colors in the high-poly mesh's file; auto is linear for glTF "
        "and USD, and sRGB for all others.",
        choices=VERTEX_COLORS,
    )
    keep_hits: bool = option(
        False, "Keep the hits in the result, to make other maps from them later."
    )
    max_memory: str | int | None = option(
        None,
        "Limit on the estimated memory of the bake, such as 2G; a larger high-poly mesh is "
        "processed in chunks, if need be straight from its binary PLY or STL file.",
        metavar="SIZE",
        default="no limit",
    )
    threads: Annotated[int | None, THREADS_OPTION] = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.maps or not isinstance(self.maps, tuple):
            raise OptionError("maps: name at least one map to bake, in a tuple")
        self._check_targets()
        if self.front == 0 and self.back == 0:
            raise OptionError("front, back: both are 0, so that no ray has any length")
        if self.scale == 0:
            raise OptionError("scale: 0 cannot code heights; give another number")
        if self.max_memory is not None:
            parse_bytes(self.max_memory)

    def _check_targets(self) -> None:
        """Raise `OptionError` for an error or a time that cannot be."""
        if self.max_error is not None:
            parse_bounds(self.max_error)
        if self.time_budget is not None:
            parse_seconds(self.time_budget)
        asked = "max_error" if self.max_error is not None else "time_budget"
        if (self.max_error is None and self.time_budget is None) or self.samples in (1, ADAPTIVE):
            if self.keep_hits and (self.is_adaptive or self.time_budget is not None):
                raise OptionError(
                    "keep_hits: hits of adaptive samples are not kept; bake with `samples=16`"
                )
            return
        raise OptionError(
            f"samples, {asked}: {self.samples} samples per texel leave nothing to choose; "
            "give one of the two"
        )

    @property
    def is_adaptive(self) -> bool:
        """Whether texels get as many samples as each needs."""
        return self.samples == ADAPTIVE or self.max_error is not None

    @property
    def error_bounds(self) -> ErrorBounds:
        """Bounds of the errors of adaptive samples."""
        return parse_bounds(self.max_error or DEFAULT_MAX_ERROR)

    def chunk_faces(self, n_high_faces: int, n_low_faces: int) -> int | None:
        """Faces of a high-poly mesh in one ray tree at a time; None for all of them.

        If not even `MOST_CHUNKS` chunks fit, the bake exceeds the limit.
        """
        left = self._memory_left(n_high_faces, n_low_faces)
        if left >= 0:
            return None
        return max(int(left // TREE_FACE) + n_high_faces, -(-n_high_faces // MOST_CHUNKS))

    def must_stream(self, n_high_faces: int, n_low_faces: int) -> bool:
        """Whether a high-poly mesh must stay in its file: `MOST_CHUNKS` chunks are too large."""
        saved = TREE_FACE * (n_high_faces - n_high_faces // MOST_CHUNKS)
        return self._memory_left(n_high_faces, n_low_faces) + saved < 0

    def streamed_chunk_faces(self, n_low_faces: int) -> int:
        """Faces that are read at a time of a high-poly mesh that stays in its file."""
        least, greatest = STREAMED_CHUNKS
        fitting = self._memory_left(0, n_low_faces) / STREAMED_FACE
        return int(min(max(fitting, least), greatest))

    def _memory_left(self, n_high_faces: int, n_low_faces: int) -> float:
        needed = bake_memory(n_high_faces, n_low_faces, self.width_px * self.height_px, self.maps)
        return memory_left(self.max_memory, needed)

    def colors_misread(self, mesh_name: str) -> str:
        """`linear` or `srgb` if colors are that, but were read as the other, by the file's name."""
        read_as = "srgb" if mesh_name.lower().endswith(_SRGB_FILES) else "linear"
        return "" if self.vertex_colors in ("auto", read_as) else self.vertex_colors

    @property
    def samples_per_side(self) -> int:
        """Samples of a texel along one side.

        Raises
        ------
        OptionError
            Samples are adaptive, which only a bake of a high-poly mesh can be.
        """
        if self.is_adaptive or not isinstance(self.samples, int):
            raise OptionError(
                "samples: adaptive is for bakes of a high-poly mesh; give 1, 4, 16 or 64"
            )
        return math.isqrt(self.samples)

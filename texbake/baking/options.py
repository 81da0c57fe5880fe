"""Every choice of a bake, with its default, written once for the API and the command line."""

from __future__ import annotations

import math
from dataclasses import dataclass

from texbake.baking.memory import bake_memory, chunk_faces, parse_bytes
from texbake.baking.secondary.options import SecondaryOptions
from texbake.durations import parse_seconds
from texbake.errors import OptionError
from texbake.mapping.options.atlas import AtlasOptions
from texbake.mapping.options.texture import MAX_SIZE, TextureOptions
from texbake.sampling.bounds import DEFAULT_MAX_ERROR, ErrorBounds, parse_bounds

SPACES = ("tangent", "object", "world")
CONVENTIONS = ("opengl", "directx")
RAYS = ("smooth", "vertex", "face")
SHADINGS = ("smooth", "flat")
FILLS = ("none", "push-pull")
VERTEX_COLORS = ("auto", "linear", "srgb")
SAMPLES = (1, 4, 16, 64)
ADAPTIVE = "adaptive"


@dataclass(frozen=True, kw_only=True)
class BakeOptions(SecondaryOptions, TextureOptions):
    """What `bake` does where the caller does not say otherwise.

    Attributes
    ----------
    maps : tuple of str
        Maps to make from the one trace; the names are the keys of `texbake.baking.maps.MAPS`.
    size : int or (int, int)
        Texels a side, or (width, height).
    samples : int or str
        Rays a texel, a square: 1, 4, 16 or 64, one at the center of each cell of an n x n grid; or
        `adaptive`: one, and more only where samples beside each other disagree, up to 64.
    max_error : str, optional
        Samples are adaptive, until the estimated error of each texel is at most this: an angle of
        normals such as `0.5deg`, a length of heights and displacement vectors in model units such
        as `0.001` or as a share of the light mesh's diagonal such as `0.01%`, or both with a comma.
        None: `0.5deg,0.01%` if samples are adaptive.
    time_budget : str or float, optional
        Wall-clock time that the bake may take, as `20s`, `2min`, or seconds: a short probe on the
        two meshes picks the least error that is predicted to fit, not below `max_error`.
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
    curvature_scale : float, optional
        Curvature, in one by model units, that is white in integer files of the curvature maps.
        None: what 99 % of the texels do not exceed.
    vertex_colors : str
        What the dense mesh's vertex colors are: `linear` light, `srgb`, or `auto`: linear in glTF
        files, whose standard says so, and sRGB in all others.
    keep_hits : bool
        Keep the trace in the result, to make other maps from it later.
    max_memory : str or int, optional
        Memory that the bake may be estimated to take, such as `2G`, or bytes. A dense mesh too
        large for that is cast at in chunks, with the same bytes; not for maps that need secondary
        rays. None: as much as it takes.
    threads : int, optional
        None: every processor.
    """

    maps: tuple[str, ...] = ("normal",)
    samples: int | str = 1
    max_error: str | None = None
    time_budget: str | float | None = None
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
    curvature_scale: float | None = None
    vertex_colors: str = "auto"
    keep_hits: bool = False
    max_memory: str | int | None = None
    threads: int | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.maps or not isinstance(self.maps, tuple):
            raise OptionError("maps: name at least one map to make, in a tuple")
        _check_choice("samples", self.samples, (*SAMPLES, ADAPTIVE))
        self._check_targets()
        _check_choice("space", self.space, SPACES)
        _check_choice("convention", self.convention, CONVENTIONS)
        _check_choice("bits", self.bits, (None, 8, 16, 32))
        _check_choice("rays", self.rays, RAYS)
        _check_choice("high_shading", self.high_shading, SHADINGS)
        _check_choice("fill", self.fill, FILLS)
        _check_choice("vertex_colors", self.vertex_colors, VERTEX_COLORS)
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
        curvature = self.curvature_scale
        if curvature is not None and not (curvature > 0 and math.isfinite(curvature)):
            raise OptionError(f"curvature-scale: {curvature} is no curvature; it must be above 0")
        if self.mid is not None and not math.isfinite(self.mid):
            raise OptionError(f"mid: {self.mid} is not a finite number")
        if self.max_memory is not None:
            parse_bytes(self.max_memory)
        if self.threads is not None and self.threads < 1:
            raise OptionError(f"threads: {self.threads} is too few; it must be at least 1")

    def _check_targets(self) -> None:
        """Raise `OptionError` where an error or a time is asked for that cannot be."""
        if self.max_error is not None:
            parse_bounds(self.max_error)
        if self.time_budget is not None:
            parse_seconds(self.time_budget)
        asked = "max-error" if self.max_error is not None else "time-budget"
        if (self.max_error is None and self.time_budget is None) or self.samples in (1, ADAPTIVE):
            if self.keep_hits and (self.is_adaptive or self.time_budget is not None):
                raise OptionError("keep_hits: adaptive samples are not kept; bake with samples=16")
            return
        raise OptionError(
            f"samples, {asked}: {self.samples} samples a texel leave nothing to choose; "
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
        """Faces of a dense mesh that rays are cast at at once; None for all of them."""
        if self.max_memory is None:
            return None
        n_texels = self.width_px * self.height_px
        whole = bake_memory(n_high_faces, n_low_faces, n_texels, len(self.maps))
        return chunk_faces(parse_bytes(self.max_memory), whole, n_high_faces)

    def colors_are_srgb(self, mesh_name: str) -> bool:
        """Whether the vertex colors of a mesh, which is called as its file, are sRGB."""
        if self.vertex_colors == "auto":
            return not mesh_name.lower().endswith((".glb", ".gltf"))
        return self.vertex_colors == "srgb"

    @property
    def samples_per_side(self) -> int:
        """Samples of a texel along one side.

        Raises
        ------
        OptionError
            Samples are adaptive, which only a bake of a dense mesh can be.
        """
        if self.is_adaptive or not isinstance(self.samples, int):
            raise OptionError("samples: adaptive is for bakes of a dense mesh; give 1, 4, 16 or 64")
        return math.isqrt(self.samples)


def _check_choice(name: str, value: object, choices: tuple[object, ...]) -> None:
    if value not in choices or isinstance(value, float):  # 4.0 equals 4, and is no number of rays
        known = ", ".join(str(choice) for choice in choices if choice is not None)
        raise OptionError(f"{name}: {value} is not one of {known}")

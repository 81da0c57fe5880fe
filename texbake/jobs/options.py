"""Every option of `run` and the demo, with its default."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Annotated, Any, TypeVar

from texbake.baking.maps import MAP_NAMES, MATERIAL_MAPS
from texbake.baking.options import BITS, CONVENTIONS, PADDING_OPTION, BakeOptions
from texbake.errors import OptionError
from texbake.mapping.options import PADDING_DEFAULT, UnwrapOptions
from texbake.mesh.options import (
    ANGLE_OPTION,
    DEFAULT_ANGLE,
    DEFAULT_ORIENTATION,
    DEFAULT_REMESH,
    JOIN_OBJECTS_OPTION,
    LOW_NORMALS_OPTION,
    MIN_FACES,
    REMESH_OPTION,
    SimplifyOptions,
    check_angle,
    check_target,
)
from texbake.records import dataclass
from texbake.rendering.options import RenderOptions, Rgb, ViewAngles
from texbake.schema import THREADS_OPTION, CheckedOptions, Size, option, option_of
from texbake.targets import OWN_FILES, PROGRAMS, SETTINGS, Target

Value = TypeVar("Value")
DEMO_FOLDER = "texbake_demo"
DEFAULT_FACES = 500
DEFAULT_SAMPLES = 4  # rays per texel where no error and no time is given
COMPARES = ("off", "quick", "full")
MIN_TRIANGLES = 1000  # an orange of fewer has no pores
_PICTURE_SIZE = 720  # pixels per side of each picture
_ALWAYS = ("normal", "displacement")  # maps that every run bakes
PICTURES = ("preview", "compare")


def with_levels(
    files: Mapping[str, Value], levels: Sequence[Mapping[str, Value]]
) -> dict[str, Value]:
    """Return files by their keys, with those of coarser levels as `lod1_mesh` and so on."""
    return dict(files) | {
        f"lod{number}_{key}": file
        for number, level in enumerate(levels, 1)
        for key, file in level.items()
    }


def scaled_size(size: Size, n_halvings: int) -> Size:
    """Return the size of a texture that is halved this many times, at least one texel.

    >>> scaled_size(1024, 2), scaled_size((512, 2), 2)
    (256, (128, 1))
    """
    if isinstance(size, int):
        return max(1, size >> n_halvings)
    return max(1, size[0] >> n_halvings), max(1, size[1] >> n_halvings)


@dataclass(frozen=True, kw_only=True)
class RunOptions(CheckedOptions):
    """How `run` goes from a high-poly mesh to a finished asset.

    The normal map inside the GLB file is always OpenGL's, because glTF demands it. The base color
    is sRGB-coded. Where `size`, `padding`, `bits` or `convention` is None, `run` takes it from the
    preset; `chosen` has the values in use.
    """

    n_faces: Annotated[int | None, option_of(SimplifyOptions, "n_faces")] = DEFAULT_FACES
    error: Annotated[str | float | None, option_of(SimplifyOptions, "error")] = None
    quality: Annotated[str, option_of(SimplifyOptions, "quality")] = SimplifyOptions.quality
    orientation: Annotated[str, option_of(SimplifyOptions, "orientation")] = DEFAULT_ORIENTATION
    remesh: Annotated[str, REMESH_OPTION] = DEFAULT_REMESH
    join_objects: Annotated[bool, JOIN_OBJECTS_OPTION] = False
    normals: Annotated[str, LOW_NORMALS_OPTION] = "auto"
    angle: Annotated[float, ANGLE_OPTION] = DEFAULT_ANGLE
    preset: str | None = option(
        None,
        "Choose size, padding, green channel, bits, names and formats as this program expects "
        "them; options that you give take precedence.",
        choices=tuple(PROGRAMS),
        default="none",
    )
    maps: tuple[str, ...] | None = option(
        None,
        "More maps to bake, besides normal, displacement and material maps.",
        choices=tuple(name for name in MAP_NAMES if name not in (*_ALWAYS, *MATERIAL_MAPS)),
        metavar="NAME,...",
        default="none",
    )
    levels: tuple[int, ...] | None = option(
        None,
        "Triangles of coarser levels of detail, the finest first. Each level has the texture "
        "coordinates of the low-poly mesh and its own maps, which are half as wide at a quarter of "
        "the triangles.",
        metavar="N,...",
        low=MIN_FACES,
        default="none",
    )
    size: Annotated[
        Size | None,
        replace(option_of(BakeOptions, "size"), default=f"{OWN_FILES.size}, or of the preset"),
    ] = None
    padding: Annotated[
        int | None,
        replace(
            PADDING_OPTION,
            default=f"{PADDING_DEFAULT}; or of the preset, in proportion to the size",
        ),
    ] = None
    bits: int | None = option(
        None,
        "Bits per channel of the normal map.",
        choices=BITS[:2],
        default=f"{OWN_FILES.normal_bits}, or of the preset",
    )
    samples: Annotated[
        int | str | None,
        replace(
            option_of(BakeOptions, "samples"),
            default=f"{DEFAULT_SAMPLES}, or adaptive with an error or a time",
        ),
    ] = None
    max_error: Annotated[str | None, option_of(BakeOptions, "max_error")] = None
    time_budget: Annotated[str | float | None, option_of(BakeOptions, "time_budget")] = None
    convention: str | None = option(
        None,
        "Green channel of the normal map: +Y up (opengl) or +Y down (directx); in the GLB "
        "file it is always opengl.",
        choices=CONVENTIONS,
        default=f"{OWN_FILES.convention}, or of the preset",
    )
    view: Annotated[ViewAngles, option_of(RenderOptions, "view")] = RenderOptions.view
    up: Annotated[str, option_of(RenderOptions, "up")] = RenderOptions.up
    base_color: Annotated[Rgb, option_of(RenderOptions, "base_color")] = RenderOptions.base_color
    compare: str = option(
        "quick",
        "How to compare the asset with the high-poly mesh: in one view with its normal map "
        "(quick), also in six views and displaced (full), or not at all (off, which draws no "
        "pictures).",
        choices=COMPARES,
    )
    threads: Annotated[int | None, THREADS_OPTION] = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if isinstance(self.maps, str):
            raise OptionError(f'maps: {self.maps} is one name; give a tuple, such as ("ao",)')
        check_target(self.n_faces, self.error)
        check_angle(self.normals, self.angle)
        counts = (*(() if self.n_faces is None else (self.n_faces,)), *(self.levels or ()))
        if any(fine <= coarse for fine, coarse in pairwise(counts)):
            raise OptionError("levels: each must have fewer triangles than the one before")
        # These check their values, now and not when half of the work is done.
        self.unwrap_options()
        self.bake_options()
        self.render_options()

    @property
    def target(self) -> Target:
        """The program that reads the files; without a preset, texbake's own names and formats."""
        return OWN_FILES if self.preset is None else PROGRAMS[self.preset]

    @property
    def own_maps(self) -> tuple[str, ...]:
        """All maps but those of materials."""
        return (*_ALWAYS, *(self.maps or ()))

    @property
    def packs_occlusion(self) -> bool:
        """Whether occlusion that no material has becomes a channel of a packed map."""
        target = self.target
        is_packed = target.packing is not None and not target.embeds
        return self.preset is not None and is_packed and "ao" in self.own_maps

    def chosen(self, name: str) -> Any:
        """Return `size`, `padding`, `bits` or `convention`: as given, or else of the preset.

        The padding of a preset is in proportion to the size; without a preset, it is None.
        """
        given, target = getattr(self, name), self.target
        if given is not None or (name == "padding" and self.preset is None):
            return given
        if name == "padding":
            size = self.chosen("size")
            side = size if isinstance(size, int) else min(size)
            return max(1, target.padding * side // target.size)
        return getattr(target, "normal_bits" if name == "bits" else name)

    def unwrap_options(self) -> UnwrapOptions:
        """Return how the low-poly mesh gets its texture coordinates."""
        size, padding = self.chosen("size"), self.chosen("padding")
        return UnwrapOptions(size=size, padding=padding, seams_at_hard_edges=True)

    def at_level(self, n_finest: int, n_faces: int, padding: int) -> RunOptions:
        """Return options for the maps of a coarser level, given the padding of the atlas."""
        n_halvings = max(0, (n_finest // n_faces).bit_length() - 1) // 2
        size = scaled_size(self.chosen("size"), n_halvings)
        padding = max(min(padding, 1), padding >> n_halvings)
        return replace(self, size=size, padding=padding, time_budget=None)

    def bake_options(
        self, channels: tuple[str, ...] = (), padding: int | None = None
    ) -> BakeOptions:
        """Return options for the bake, with channels of the model's materials.

        `padding` is the padding of the atlas.
        """
        return BakeOptions(
            maps=tuple(dict.fromkeys((*self.own_maps, *channels))),
            size=self.chosen("size"),
            padding=padding or 0,
            samples=self._bake_samples,
            max_error=self.max_error,
            time_budget=self.time_budget,
            convention=self.chosen("convention"),
            fill="push-pull",
            orientation="keep",  # flipped before it is simplified
            threads=self.threads,
        )

    def names_of_levels(self, asset: str, images: Sequence[str] = ()) -> list[dict[str, str]]:
        """Return the names of the files of each level of detail by their keys, the finest first.

        `images` are those of materials, by the ends of their names.
        """
        names = [self._names_of(asset, images)]
        names[0]["report"] = f"{asset}_report.json"
        if self.preset is not None:
            names[0]["settings"] = SETTINGS
        if self.compare != "off":
            names[0] |= {key: f"{asset}_{key}.png" for key in PICTURES}
        levels = range(1, 1 + len(self.levels or ()))
        return [*names, *(self._names_of(f"{asset}_lod{level}", images) for level in levels)]

    def _names_of(self, asset: str, images: Sequence[str]) -> dict[str, str]:
        target, has_preset = self.target, self.preset is not None
        # The mesh comes first: in a pipeline, the name of the step alone means its first output.
        main = "mesh" if target.mesh_format == "obj" else "glb"
        names = {main: f"{target.mesh_stem(asset)}.{target.mesh_format}"}
        for key in self.own_maps:
            is_float = key == "displacement" and target.heights == "float"
            names[key] = f"{target.map_stem(asset, key)}.{'exr' if is_float else 'png'}"
        if not has_preset:
            names["glb"] = f"{target.mesh_stem(asset)}.glb"
        if self.packs_occlusion and not images:
            images = ("orm",)
        for key in images:
            kind = key.replace("_", "-") if has_preset else key
            kind = (target.packing or kind) if kind == "orm" else kind
            names[key] = f"{target.map_stem(asset, kind)}.png"
        return names

    @property
    def _bake_samples(self) -> int | str:
        if self.samples is not None:
            return self.samples
        is_adaptive = self.max_error is not None or self.time_budget is not None
        return BakeOptions.samples if is_adaptive else DEFAULT_SAMPLES

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
class DemoOptions(CheckedOptions):
    """How large the meshes and maps of `demo` are."""

    triangles: int = option(
        1_000_000,
        "Approximate number of triangles of the high-poly mesh.",
        metavar="N",
        low=MIN_TRIANGLES,
    )
    faces: int = option(
        DEFAULT_FACES, "Number of triangles of the low-poly mesh.", metavar="N", low=MIN_FACES
    )
    # As many texels as triangles, and about one for each pixel of the pictures.
    size: Annotated[Size, option_of(BakeOptions, "size")] = 1024
    threads: Annotated[int | None, THREADS_OPTION] = None

    def __post_init__(self) -> None:
        super().__post_init__()
        self.run_options()

    def run_options(self) -> RunOptions:
        """Return how the whole job is done."""
        return RunOptions(
            n_faces=self.faces,
            size=self.size,
            view=(30.0, 32.0),  # down on the stem
            base_color=(0.94, 0.55, 0.16),
            compare="full",
            threads=self.threads,
        )

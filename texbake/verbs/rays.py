"""Options that several bakes share, and the names of their files."""

from __future__ import annotations

from texbake.baking.file_names import DEFAULT_PATTERN
from texbake.baking.options import BakeOptions
from texbake.verbs.step import IMAGE_FORMATS
from texbake.verbs.verb import REPORT, Extra, Options, Reads, Writes

FORMAT = Extra(
    "--format",
    "File format of the maps; exr and tif store heights as floats.  [default: png]",
    choices=IMAGE_FORMATS,
)
NAME_PATTERN = Extra(
    "--name-pattern",
    "Names of the files: {asset} is the low-poly mesh's file without suffix, {map} the map, "
    "{set} the texture set, {udim} the tile (with it all tiles are baked), {ext} the format.",
    default=DEFAULT_PATTERN,
    show_default=True,
    metavar="PATTERN",
)
HEIGHTS = Options(BakeOptions, "mid", "scale")
RAYS = (
    Options(BakeOptions, "size", "samples", "max_error", "time_budget"),
    Options(BakeOptions, "space", "convention", "bits", "front", "back", "max_reach"),
    Reads(
        "cage",
        "mesh",
        "Start the rays on this mesh, which is the low-poly mesh with its vertices moved outwards.",
        required=False,
    ),
    Options(BakeOptions, "rays"),
    Reads(
        "skew_mask",
        "image",
        "Blend the direction of the rays by this image on the low-poly mesh's coordinates, "
        "from --rays (0) to the face's normal (1).",
        required=False,
    ),
    Reads(
        "offset_map",
        "image",
        "Multiply the front distance, or the cage's offset, by this image. Values are 0 to 1; "
        "float files may hold greater ones.",
        required=False,
    ),
    Options(BakeOptions, "orientation", "high_shading", "high_normal_maps"),
    Options(BakeOptions, "cull_back_faces", "padding", "fill"),
    Options(BakeOptions, "on_miss", "fail_on_miss", "bake_island"),
    Writes("miss_map", "picture", "Also draw where rays missed."),
    REPORT,
    Options(BakeOptions, "max_memory", "threads"),
)
SOURCES = (
    Reads(
        "high_texture",
        "image",
        "Image on the high-poly mesh's texture coordinates, for one map of its materials, such "
        "as base-color, or roughness, which is data.  [default: those that its file names]",
        required=False,
    ),
    Options(BakeOptions, "vertex_colors", "curvature_scale"),
    NAME_PATTERN,
    Writes(
        "hits",
        "hits",
        "Also keep the hits, from which texbake remap makes other maps.",
    ),
)

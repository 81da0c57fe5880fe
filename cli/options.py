"""Options that several commands share; every default is read from the API's options."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, TypeVar, cast

import click
from click.core import ParameterSource

from texbake.baking.options import (
    CONVENTIONS,
    FILLS,
    RAYS,
    SHADINGS,
    SPACES,
    BakeOptions,
)
from texbake.jobs.options import DEFAULT_SAMPLES
from texbake.mesh.files import (
    MESH_SUFFIXES as MESH_SUFFIXES,
    WRITABLE_MESH_SUFFIXES as WRITABLE_MESH_SUFFIXES,
)
from texbake.rendering.options import BACK_FACES, UPS, RenderOptions

from .types import FileOf, Size, View

Command = TypeVar("Command", bound=Callable[..., Any])
Decorator = Callable[[Command], Command]

IMAGE_SUFFIXES = (".exr", ".hdr", ".jpg", ".jpeg", ".png", ".ppm", ".tga", ".tif", ".tiff")


def mesh_argument(name: str) -> Decorator[Any]:
    """Add an argument that names a mesh file to read."""
    return click.argument(name, type=FileOf(MESH_SUFFIXES))


def mesh_option(flag: str, text: str) -> Decorator[Any]:
    """Add an option that names a mesh file to read."""
    return click.option(flag, type=FileOf(MESH_SUFFIXES), metavar="MESH", help=text)


def image_option(flag: str, text: str) -> Decorator[Any]:
    """Add an option that names an image file to read."""
    return click.option(flag, type=FileOf(IMAGE_SUFFIXES), metavar="IMAGE", help=text)


def output_file(text: str, suffixes: Sequence[str]) -> Decorator[Any]:
    """Add `-o FILE`, which must be given."""
    return click.option(
        "-o", "--output", type=FileOf(suffixes), required=True, metavar="FILE", help=text
    )


def output_folder(text: str, **extra: Any) -> Decorator[Any]:
    """Add `-o DIR`."""
    folder = click.Path(path_type=Path, file_okay=False)
    return click.option("-o", "--output", type=folder, metavar="DIR", help=text, **extra)


def picture_option(flag: str, text: str) -> Decorator[Any]:
    """Add an option that names a picture to write as well."""
    return click.option(flag, type=FileOf((".png",)), metavar="FILE.png", help=text)


report_option = click.option(
    "--report",
    type=FileOf((".json",)),
    metavar="FILE.json",
    help="Also write what was done, with every setting and figure, as JSON.",
)

threads_option = click.option(
    "--threads", type=int, metavar="N", help="Threads to work with.  [default: every processor]"
)


def size_option(default: Any, text: str) -> Decorator[Any]:
    """Add `--size PX|WxH`."""
    return click.option("--size", type=Size(), default=default, show_default=True, help=text)


def choice_option(
    flag: str, choices: Sequence[str], default: str | None, text: str
) -> Decorator[Any]:
    """Add an option that takes one word of a few."""
    return click.option(
        flag, type=click.Choice(choices), default=default, show_default=True, help=text
    )


def number_option(
    flag: str, kind: Callable[[Any], Any], default: Any, metavar: str, text: str
) -> Decorator[Any]:
    """Add an option that takes a number; its range is the options' own to check."""
    return click.option(
        flag, type=kind, default=default, show_default=True, metavar=metavar, help=text
    )


def _view_option(*, turns: bool) -> Decorator[Any]:
    return click.option(
        "--view",
        type=View(turns=turns),
        default=",".join(f"{angle:g}" for angle in RenderOptions.view if angle is not None),
        show_default=True,
        help="Azimuth and elevation in degrees, and the distance from the middle in model units"
        + ("; or a whole turn of N pictures." if turns else "."),
    )


view_option = _view_option(turns=False)


def _picture_options(*, turns: bool) -> tuple[Decorator[Any], ...]:
    return (
        size_option(f"{RenderOptions.width}x{RenderOptions.height}", "Pixels of the picture."),
        _view_option(turns=turns),
        choice_option(
            "--up", UPS, RenderOptions.up, "Axis of the world that is up in the picture."
        ),
        choice_option(
            "--back-faces",
            BACK_FACES,
            RenderOptions.back_faces,
            "Triangles that are seen from behind.",
        ),
        number_option(
            "--supersampling",
            int,
            RenderOptions.supersampling,
            "N",
            "Samples of a pixel along one side, N x N in all.",
        ),
    )


_PICTURE_NAMES = ("size", "view", "up", "back_faces", "supersampling")


def picture_options(command: Command) -> Command:
    """Add how a picture is taken: `--size`, `--view` and `--up`; received as `RenderOptions`."""

    @functools.wraps(command)
    def with_picture(*args: Any, **options: Any) -> None:
        picture = _sized({name: options.pop(name) for name in _PICTURE_NAMES})
        command(*args, picture=RenderOptions(**picture), **options)

    return _all_of(_picture_options(turns=False), cast(Command, with_picture))


def picture_changes(command: Command) -> Command:
    """Add the same, and a whole turn for a view; received as a dictionary of what was given.

    What a scene's file says stands where nothing is given.
    """

    @functools.wraps(command)
    def with_changes(*args: Any, **options: Any) -> None:
        source = click.get_current_context().get_parameter_source
        picture = {name: options.pop(name) for name in _PICTURE_NAMES}
        given = {
            name: value
            for name, value in picture.items()
            if source(name) not in (ParameterSource.DEFAULT, None)
        }
        command(*args, picture=_sized(given), **options)

    return _all_of(_picture_options(turns=True), cast(Command, with_changes))


def _sized(options: dict[str, Any]) -> dict[str, Any]:
    """Return options with width and height in place of the size."""
    size = options.pop("size", None)
    if size is None:
        return options
    width, height = (size, size) if isinstance(size, int) else size
    return {"width": width, "height": height, **options}


def _samples(word: str | int) -> int | str:
    """Numbers as numbers; words are the options' own to check."""
    return int(word) if str(word).isdecimal() else word


_MEASURED = "[default: measured from the meshes]"


def _sample_options(default: int | str | None, text: str = "") -> tuple[Decorator[Any], ...]:
    """How many rays a texel gets, or what is asked for in their place."""
    return (
        number_option(
            "--samples",
            _samples,
            default,
            "1|4|16|64|adaptive",
            "Rays a texel, averaged as directions and not as colors; adaptive: more where they "
            f"differ.{text}",
        ),
        number_option(
            "--max-error",
            str,
            BakeOptions.max_error,
            "E",
            "Adaptive samples until each texel is estimated to be off by at most so much: 0.5deg "
            "for normals, 0.001 (model units) or 0.01% (of the diagonal) for heights, or "
            "0.5deg,0.001.",
        ),
        number_option(
            "--time-budget",
            str,
            BakeOptions.time_budget,
            "T",
            "Pick what is predicted to bake in 20s, 2min, ...; a short probe tells how long it "
            "takes.",
        ),
    )


_BAKE_OPTIONS = (
    size_option(BakeOptions.size, "Texels of the maps."),
    *_sample_options(BakeOptions.samples),
    choice_option("--space", SPACES, BakeOptions.space, "Space of the normals."),
    choice_option(
        "--convention",
        CONVENTIONS,
        BakeOptions.convention,
        "Green channel: opengl is +Y up, directx +Y down.",
    ),
    number_option(
        "--bits",
        int,
        BakeOptions.bits,
        "8|16|32",
        "Bits a channel; 32 is float.  [default: the most that the format holds]",
    ),
    number_option(
        "--front",
        float,
        BakeOptions.front,
        "D",
        f"How far outside the light mesh rays start, in model units.  {_MEASURED}",
    ),
    number_option(
        "--back",
        float,
        BakeOptions.back,
        "D",
        f"How far inside the light mesh rays end, in model units.  {_MEASURED}",
    ),
    mesh_option(
        "--cage", "Start rays on this mesh, which has the light mesh's faces moved outwards."
    ),
    choice_option(
        "--rays",
        RAYS,
        BakeOptions.rays,
        "Direction of rays: smooth normals without gaps, the light mesh's own at its vertices, "
        "or each face's.",
    ),
    image_option(
        "--skew-mask",
        "Where this image is 1, on the light mesh's coordinates, rays go straight along the face's "
        "normal; where 0, as --rays says; a blend between.",
    ),
    image_option(
        "--offset-map",
        "Multiply the front distance, or the cage's, by this image, 0 to 1, or above in floats.",
    ),
    choice_option(
        "--high-shading",
        SHADINGS,
        BakeOptions.high_shading,
        "Normals of the dense mesh: its own or averaged, or one a face.",
    ),
    click.option(
        "--cull-back-faces/--hit-back-faces",
        default=BakeOptions.cull_back_faces,
        show_default=True,
        help="Let rays pass through surfaces seen from behind, or not.",
    ),
    number_option(
        "--padding",
        int,
        BakeOptions.padding,
        "PX",
        "Texels around each chart that repeat its edge.",
    ),
    choice_option("--fill", FILLS, BakeOptions.fill, "What fills the rest of a map."),
    number_option(
        "--fail-on-miss",
        float,
        BakeOptions.fail_on_miss,
        "PERCENT",
        "Write nothing and fail if more of the texels missed the dense mesh.",
    ),
    picture_option("--miss-map", "Also draw where rays missed."),
    report_option,
    number_option(
        "--max-memory",
        str,
        BakeOptions.max_memory,
        "SIZE",
        "Memory that the bake may be estimated to take, such as 2G; a dense mesh too large for "
        "that is cast at in chunks.  [default: as much as it takes]",
    ),
    threads_option,
)

_HEIGHT_OPTIONS = (
    number_option(
        "--mid",
        float,
        BakeOptions.mid,
        "M",
        "Value of height 0 in an integer file, in [0, 1].  [default: 0.5]",
    ),
    number_option(
        "--scale",
        float,
        BakeOptions.scale,
        "S",
        "Height that a change of 1 in an integer file stands for, in model units.  "
        "[default: the least that holds every height]",
    ),
)

_SECONDARY_OPTIONS = (
    number_option(
        "--secondary-rays",
        int,
        BakeOptions.secondary_rays,
        "N",
        "Rays a sample for ao, bent-normal and thickness, a power of two.",
    ),
    number_option(
        "--occluder-distance",
        float,
        BakeOptions.occluder_distance,
        "D",
        "How far a surface hides what lies behind it, in model units, for ao and bent-normal.  "
        "[default: however far it is]",
    ),
    number_option(
        "--thickness-distance",
        float,
        BakeOptions.thickness_distance,
        "D",
        "Thickness, in model units, that is white; rays into the surface go no farther.  "
        "[default: the greatest of the map]",
    ),
)


def bake_options(command: Command) -> Command:
    """Add what every bake takes."""
    return _all_of(_BAKE_OPTIONS, command)


def run_sample_options(command: Command) -> Command:
    """Add how finely the maps of the whole job are sampled."""
    return _all_of(_sample_options(None, f"  [default: {DEFAULT_SAMPLES}]"), command)


def height_options(command: Command) -> Command:
    """Add how heights are coded."""
    return _all_of(_HEIGHT_OPTIONS, command)


def secondary_options(command: Command) -> Command:
    """Add how rays from the dense surface look around."""
    return _all_of(_SECONDARY_OPTIONS, command)


def _all_of(options: Sequence[Decorator[Any]], command: Command) -> Command:
    for option in reversed(options):
        command = option(command)
    return command

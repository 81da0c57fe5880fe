"""`texbake bake-texture`: bake procedures or photographs into the texture of a mesh."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click

import texbake
from texbake import (
    OptionError,
    PhotoOptions,
    SolidOptions,
    TextureBakeOptions,
)

from ..options import (
    IMAGE_SUFFIXES,
    MESH_SUFFIXES,
    bits_option,
    mesh_argument,
    options_of,
    output_file,
    picture_option,
    report_option,
    threads_option,
)
from ..sections import SectionedCommand
from ..terminal import Terminal, terminal_options
from ..types import FileOf

CAMERA_SUFFIXES = (".toml", ".txt")

_SOLID = ("procedure", "param", "volume", "scale", "colors")
_PHOTO = ("photo", "camera", "max_angle", "falloff", "feather", "margin", "occlusion")


@click.command(
    cls=SectionedCommand,
    sections={"A solid procedure": _SOLID, "Photographs": _PHOTO},
    epilog="""
    \b
    Example:
      texbake bake-texture bust.obj -o marble.png --procedure marble --param amount=5
      texbake bake-texture vase.obj -o wood.png --procedure wood --colors "#2b1a10,#c89a5b"
      texbake bake-texture a.obj -o t.png --photo a.jpg --camera a.txt --photo b.png --camera b.txt
      texbake bake-texture head.obj -o head.png --photo left.jpg --photo-uvs left.obj
    """,
)
@mesh_argument("mesh")
@output_file("The texture.", IMAGE_SUFFIXES)
@options_of(SolidOptions, "procedure", unset=True)
@click.option(
    "--param",
    multiple=True,
    metavar="KEY=VALUE",
    help="Set a parameter of the procedure; repeatable.",
)
@options_of(SolidOptions, "volume", "scale", "colors")
@click.option(
    "--data", is_flag=True, help="Treat the values as data, such as roughness, not as colors."
)
@click.option(
    "--photo",
    multiple=True,
    type=FileOf(IMAGE_SUFFIXES),
    metavar="IMAGE",
    help="A photograph of the object; repeatable.",
)
@click.option(
    "--camera",
    "--photo-uvs",
    multiple=True,
    type=FileOf((*CAMERA_SUFFIXES, *MESH_SUFFIXES)),
    metavar="FILE",
    help="Where each photograph was taken from, in their order: a TOML file with position, target, "
    "up, fov and aspect, a text file with a 4 x 4 matrix, or a mesh of the same faces whose "
    "texture coordinates are positions in the photograph.",
)
@options_of(PhotoOptions, "max_angle", "falloff", "feather", "margin", "occlusion")
@options_of(TextureBakeOptions, without=("threads",))
@bits_option
@picture_option("--unseen-map", "Also draw which texels no photograph shows.")
@report_option
@threads_option
@terminal_options
def bake_texture(
    mesh: Path,
    output: Path,
    data: bool,
    bits: int | None,
    unseen_map: Path | None,
    report: Path | None,
    terminal: Terminal,
    **choices: Any,
) -> None:
    """Bake a procedure or photographs into a texture.

    A solid procedure or a volume has no seams, because it is evaluated in space. Photographs are
    blended by how well each shows a point. Texels that no photograph shows are filled from their
    surroundings and reported.
    """
    photos, cameras = choices.pop("photo"), choices.pop("camera")
    options = _options(photos, cameras, choices)
    with terminal.progress() as progress:
        done = texbake.bake_texture_files(
            mesh,
            output,
            options,
            photos=photos,
            cameras=cameras,
            data=data,
            bits=bits,
            unseen_map=unseen_map,
            report=report,
            progress=progress,
        )
    for warning in done.warnings:
        terminal.warn(warning)
    terminal.summary(done.report.table())
    terminal.wrote(done.files)


def _options(
    photos: Sequence[Path], cameras: Sequence[Path], choices: dict[str, Any]
) -> SolidOptions | PhotoOptions:
    """Return the options of the requested bake: a procedure or photographs."""
    solid = {name: choices.pop(name) for name in _SOLID}
    cast = {name: choices.pop(name) for name in _PHOTO if name in choices}
    given = (solid["procedure"] is not None, bool(solid["volume"]), bool(photos))
    if sum(given) != 1:
        raise OptionError("procedure, volume, photo: give a procedure, a volume or photographs")
    if photos:
        if len(photos) != len(cameras):
            raise OptionError(
                f"camera: {len(cameras)} are given for {len(photos)} photographs; give one for "
                "each, in order: --photo A.jpg --camera A.toml"
            )
        return PhotoOptions(**cast, **choices)
    if cameras:
        raise OptionError("camera: it goes with --photo; a procedure has none")
    return SolidOptions(
        procedure=solid["procedure"] or SolidOptions.procedure,
        volume=solid["volume"],
        parameters=dict(map(_parameter, solid["param"])),
        scale=solid["scale"],
        colors=None if solid["colors"] is None else _ramp(solid["colors"]),
        **choices,
    )


def _parameter(text: str) -> tuple[str, Any]:
    """Parse KEY=VALUE: a number, several with commas, or a word."""
    key, equals, value = text.partition("=")
    if not equals or not key.strip():
        raise OptionError(f"param: {text!r} is not of the form KEY=VALUE, such as amount=5")
    numbers = [_number(word) for word in value.split(",")]
    if any(number is None for number in numbers):
        return key.strip(), value.strip()
    return key.strip(), numbers[0] if len(numbers) == 1 else tuple(numbers)


def _number(word: str) -> int | float | None:
    for kind in int, float:
        try:
            return kind(word)
        except ValueError:
            continue
    return None


def _ramp(text: str) -> tuple[tuple[float, float, float], ...]:
    """Linear colors of sRGB ones, written as #RRGGBB."""
    colors = []
    for word in text.split(","):
        digits = word.strip().removeprefix("#")
        try:
            codes = bytes.fromhex(digits)
        except ValueError:
            codes = b""
        if len(codes) != 3:
            raise OptionError(f"colors: {word!r} is no color such as #c89a5b")
        red, green, blue = texbake.decode_srgb([code / 255.0 for code in codes]).tolist()
        colors.append((red, green, blue))
    return tuple(colors)

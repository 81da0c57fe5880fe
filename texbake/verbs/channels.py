"""`pack-channels` and `split-channels`: gray maps as the channels of one image, and back.

Values are data: codes are copied, and nothing is converted between sRGB and linear. glTF packs
occlusion, roughness and metallic as red, green and blue.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from texbake.baking.memory import MB, PROCESS
from texbake.baking.options import BITS_OPTION
from texbake.errors import OptionError, counted, quoted
from texbake.files import PathLike
from texbake.jobs.outputs import JobResult, check_distinct, present_paths
from texbake.records import dataclass
from texbake.schema import CheckedOptions, Option
from texbake.verbs.step import DECODED, FORMAT_OF_IMAGE, Job, Settings, Sizes, n_bytes, step_of
from texbake.verbs.verb import THREADS, Extra, Options, Reads, Rows, Writes, paths_of, verb

if TYPE_CHECKING:
    from texbake.texture.image import FloatImage, Image


@dataclass(frozen=True, kw_only=True)
class PackChannelsOptions(CheckedOptions):
    """How `pack_channels_file` writes its image."""

    bits: Annotated[int | None, replace(BITS_OPTION, default="those of the images")] = None


COLORS = ("red", "green", "blue", "alpha")
_LETTERS = "rgba"


@dataclass(frozen=True)
class ChannelsReport:
    """The image that `pack_channels_file` made, or that `split_channels_files` read."""

    width: int  # texels
    height: int
    channels: tuple[str, ...]  # what each channel comes from, or goes to

    def table(self) -> Rows:
        """Return rows of a label and a figure."""
        rows = zip(COLORS, self.channels, strict=False)
        return [("size", f"{self.width} x {self.height}"), *(row for row in rows if row[1])]


@verb(
    *(
        Extra(
            f"--{name}",
            f"What goes to {name}: a gray map, one channel of an image, or a value from 0 to 1 "
            "for all texels.",
            metavar="FILE[:r|g|b|a]|VALUE",
            required=name != "alpha",
        )
        for name in COLORS
    ),
    Writes("output", "image", "The image with these channels."),
    Options(PackChannelsOptions),
    THREADS,
    examples="""
      texbake pack-channels --red ao.png --green roughness.png --blue metallic.png -o orm.png
      texbake pack-channels --red rock.exr:g --green 0.5 --blue 0 -o orm.png --bits 8
    """,
)
def pack_channels_file(
    output: PathLike,
    red: PathLike | float,
    green: PathLike | float,
    blue: PathLike | float,
    alpha: PathLike | float | None = None,
    options: PackChannelsOptions | None = None,
    *,
    threads: int | None = None,
) -> JobResult[ChannelsReport]:
    """Pack gray maps as the channels of one image.

    glTF and Unreal take occlusion as red, roughness as green and metallic as blue. The maps are
    data: their codes are copied, with no conversion between sRGB and linear.
    """
    import numpy as np

    from texbake.texture.image import read_image, write_image
    from texbake.texture.image_formats import check_image_format

    bits = (options or PackChannelsOptions()).bits
    given_channels = [red, green, blue] if alpha is None else [red, green, blue, alpha]
    sources = [_source(value) for value in given_channels]
    files = [file for file, _ in sources if isinstance(file, Path)]
    if not files:
        raise OptionError("red, green, blue: none is an image, so there is no size to give it")
    check_distinct([output], files)
    check_image_format(output, bits, channels=len(sources), lossless=True)
    images = {file: read_image(file, color=False, threads=threads) for file in dict.fromkeys(files)}
    height, width = _common_size(images)
    pixels = np.empty((height, width, len(sources)), np.float32)
    for i, (file, letter) in enumerate(sources):
        pixels[..., i] = _channel(images[file], letter) if isinstance(file, Path) else file
    if bits is None:
        deepest = max(images.values(), key=lambda image: (image.is_float, image.bits))
        bits = _bits_like(deepest, output, pixels)
    write_image(pixels, output, bits=bits, threads=threads)
    report = ChannelsReport(width, height, tuple(str(value) for value in given_channels))
    return JobResult(files=present_paths(output), report=report)


def _bits_like(image: Image, path: PathLike, pixels: FloatImage) -> int | None:
    """Return the bits that keep an image's codes, or None for the most that the format has."""
    from texbake.texture.image_files import bits_for
    from texbake.texture.image_formats import format_of

    if image.is_float:
        return bits_for(path, pixels, image)
    return image.bits if image.bits in format_of(path).bits else None


def _source(value: PathLike | float) -> tuple[Path | float, str]:
    """Return a file and the letter of its channel, "" if none is named; or a value and ""."""
    if isinstance(value, (int, float)):
        number = float(value)
    else:
        text = str(value)
        try:
            number = float(text)
        except ValueError:
            name, colon, letter = text.rpartition(":")
            is_named = bool(name) and bool(colon) and len(letter) == 1 and letter in _LETTERS
            return (Path(name), letter) if is_named else (Path(text), "")
    if not 0.0 <= number <= 1.0:
        raise OptionError(f"red, green, blue, alpha: {value} is not from 0 to 1")
    return number, ""


def _common_size(images: dict[Path, Image]) -> tuple[int, int]:
    """Return the height and width that all images have."""
    sizes = {image.pixels.shape[:2] for image in images.values()}
    if len(sizes) > 1:
        words = ", ".join(
            f"{path.name} {image.pixels.shape[1]} x {image.pixels.shape[0]}"
            for path, image in images.items()
        )
        raise OptionError(f"maps to be packed differ in size: {words}; scale them")
    (size,) = sizes
    return size


def _channel(image: Image, letter: str) -> FloatImage:
    """Return the (H, W) values of a channel; of a gray image without a letter, the first."""
    n_channels = image.pixels.shape[2]
    if letter:
        index = _LETTERS.index(letter)
        if n_channels <= 2 and letter != "r":
            index = 1 if letter == "a" and n_channels == 2 else n_channels
        if index >= n_channels:
            raise OptionError(f"{image.name}: it has no {COLORS[_LETTERS.index(letter)]} channel")
        return image.pixels[..., index]
    first = image.pixels[..., 0]
    if n_channels >= 3 and not (image.pixels[..., 1:3] == first[..., None]).all():
        raise OptionError(
            f"{image.name}: its channels differ, so one must be named, such as {image.name}:g"
        )
    return first


@dataclass(frozen=True, kw_only=True)
class PackChannelsStep(CheckedOptions):
    """What channels without a map hold, and the format."""

    red_value: Annotated[
        float, Option("Value of red in all texels, if no map is given for it.", low=0, high=1)
    ] = 1.0
    green_value: Annotated[
        float, Option("Value of green in all texels, if no map is given for it.", low=0, high=1)
    ] = 1.0
    blue_value: Annotated[
        float, Option("Value of blue in all texels, if no map is given for it.", low=0, high=1)
    ] = 0.0
    format: Annotated[str, FORMAT_OF_IMAGE] = "png"


def _channels(job: Job) -> dict[str, Any]:
    """Return the maps of a step, or values for channels that have none."""
    values = {color: job.settings[f"{color}_value"] for color in COLORS[:3]}
    maps = {color: job.input(color) or values.get(color) for color in COLORS}
    return {"output": job.outputs["texture"], "options": None, **maps}


def _size(result: JobResult[ChannelsReport]) -> dict[str, Any]:
    return {"width": result.report.width, "height": result.report.height}


def _check_maps(settings: Settings, roles: frozenset[str]) -> None:
    if not roles:
        raise OptionError("red, green, blue: give a map for at least one channel")


def _memory(settings: Settings, sizes: Sizes) -> int:
    """Estimate for packing channels into one image, or splitting one."""
    return PROCESS + 64 * MB + 2 * DECODED * n_bytes(sizes, "image", *COLORS)


PACK = step_of(
    pack_channels_file,
    does="packs gray maps as the channels of one image",
    options=PackChannelsStep,
    inputs=tuple(Reads(color, required=False) for color in COLORS),
    outputs=lambda settings: {"texture": f"texture.{settings['format']}"},
    prepare=_channels,
    figures=_size,
    memory=_memory,
    check=_check_maps,
)


def _split_names(values: dict[str, Any]) -> dict[str, Any]:
    names = values["names"]
    return {**values, "names": None if names is None else names.split(",")}


@verb(
    Reads("image", "image"),
    Writes("output", "folder", "Folder for the maps; made if it is missing."),
    Extra(
        "--names",
        "What each channel is, for the names of the files; an empty name leaves a channel out.  "
        "[default: red,green,blue,alpha]",
        metavar="NAME,...",
    ),
    THREADS,
    examples="""
      texbake split-channels orm.png -o maps --names occlusion,roughness,metallic
      texbake split-channels orm.png -o maps --names ,roughness
    """,
    prepare=_split_names,
)
def split_channels_files(
    image: PathLike,
    output: PathLike | Sequence[PathLike],
    *,
    names: Sequence[str] | None = None,
    threads: int | None = None,
) -> JobResult[ChannelsReport]:
    """Split IMAGE into a gray map for each channel.

    The maps are data: their codes are copied, with the bits of IMAGE and no conversion between
    sRGB and linear.
    """
    from texbake.texture.image import read_image
    from texbake.texture.image_files import suffix_like, write_images

    read = read_image(image, color=False, threads=threads)
    height, width, n_channels = read.pixels.shape
    gray = ("gray", "alpha")[:n_channels]
    usual = gray if n_channels < 3 else COLORS[:n_channels]
    chosen = tuple(usual if names is None else names)
    _check_names(image, chosen, n_channels)
    used = [i for i, name in enumerate(chosen) if name]
    if isinstance(output, str | os.PathLike):
        stem, suffix = Path(image).stem, suffix_like(read)
        files = [Path(output) / f"{stem}_{chosen[i]}{suffix}" for i in used]
    elif len(files := paths_of(output)) != len(used):
        raise OptionError(
            f"output: {counted(len(files), 'file is', 'files are')} given for "
            + counted(len(used), "channel")
        )
    maps = {file: read.pixels[..., i : i + 1] for file, i in zip(files, used, strict=True)}
    check_distinct(list(maps), [image])
    write_images(maps, color=False, bits=_bits_like(read, files[0], read.pixels), threads=threads)
    return JobResult(files=tuple(maps), report=ChannelsReport(width, height, chosen))


def _check_names(image: PathLike, names: Sequence[str], n_channels: int) -> None:
    if len(names) > n_channels:
        raise OptionError(
            f"names: {counted(len(names), 'is', 'are')} given, but {image} has "
            + counted(n_channels, "channel")
        )
    used = [name for name in names if name]
    if not used:
        raise OptionError("names: all are empty, so there is nothing to write")
    for name in used:
        if used.count(name) > 1:
            raise OptionError(f"names: {name} is given twice")
        if Path(name).name != name or name in (".", ".."):
            raise OptionError(f"names: {quoted(name)} cannot be a part of a file name")


@dataclass(frozen=True, kw_only=True)
class SplitChannelsStep(CheckedOptions):
    """What the channels are, and the format of their maps."""

    names: Annotated[
        tuple[str, ...],
        Option(
            "What each channel is, in their order: the names of the outputs. An empty name leaves "
            "a channel out.",
            metavar="NAME,...",
        ),
    ] = COLORS[:3]
    format: Annotated[str, FORMAT_OF_IMAGE] = "png"

    def __post_init__(self) -> None:
        super().__post_init__()
        if not any(self.names):
            raise OptionError("names: all are empty")


SPLIT = step_of(
    split_channels_files,
    does="splits an image into a gray map for each channel",
    options=SplitChannelsStep,
    outputs=lambda settings: {
        name: f"{name}.{settings['format']}" for name in settings["names"] if name
    },
    prepare=lambda job: {"output": list(job.outputs.values())},
    figures=_size,
    memory=_memory,
)

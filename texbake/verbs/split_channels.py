"""`split-channels`: split an image into a gray map for each channel."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from texbake.errors import OptionError, counted, quoted
from texbake.files import PathLike
from texbake.jobs.outputs import JobResult, check_distinct
from texbake.schema import CheckedOptions, Option
from texbake.verbs.pack_channels import COLORS, ChannelsReport, bits_like, channels_memory
from texbake.verbs.step import FORMAT_OF_IMAGE, Job, step_of
from texbake.verbs.verb import THREADS, Extra, Reads, Writes, paths_of, verb


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
def split_channel_files(
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
    bits = bits_like(read, files[0], read.pixels)
    write_images(maps, color=False, bits=bits, threads=threads)
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


def _step(job: Job) -> dict[str, Any]:
    options: SplitChannelsStep = STEP.made(job.settings)
    files = [job.outputs[name] for name in options.names if name]
    split = split_channel_files(
        job.file("image"), files, names=options.names, threads=job.threads
    ).report
    return {"width": split.width, "height": split.height}


STEP = step_of(
    split_channel_files,
    does="splits an image into a gray map for each channel",
    options=SplitChannelsStep,
    outputs=lambda settings: {
        name: f"{name}.{settings['format']}" for name in settings["names"] if name
    },
    run=_step,
    memory=channels_memory,
)

"""Steps about the channels of images: `pack-channels`, `split-channels`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

from texbake.building.memory import channels_memory
from texbake.errors import OptionError
from texbake.schema import CheckedOptions, Option
from texbake.verbs.step import FORMAT_OF_IMAGE, Job, Settings, StepKind
from texbake.verbs.verb import Reads

_COLORS = ("red", "green", "blue", "alpha")


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


def _pack_channels(job: Job) -> dict[str, Any]:
    from texbake.jobs.channels import pack_channel_files

    options: PackChannelsStep = PACK_CHANNELS.made(job.settings)
    values = (options.red_value, options.green_value, options.blue_value)
    red, green, blue = (
        job.input(color) or value for color, value in zip(_COLORS, values, strict=False)
    )
    packed = pack_channel_files(
        job.outputs["texture"], red, green, blue, job.input("alpha"), threads=job.threads
    ).report
    return {"width": packed.width, "height": packed.height}


def _check_maps(settings: Settings, roles: frozenset[str]) -> None:
    if not roles:
        raise OptionError("red, green, blue: give a map for at least one channel")


PACK_CHANNELS = StepKind(
    name="pack-channels",
    does="packs gray maps as the channels of one image",
    options=PackChannelsStep,
    inputs=tuple(Reads(color, required=False) for color in _COLORS),
    outputs=lambda settings: {"texture": f"texture.{settings['format']}"},
    run=_pack_channels,
    memory=channels_memory,
    check=_check_maps,
)


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
    ] = _COLORS[:3]
    format: Annotated[str, FORMAT_OF_IMAGE] = "png"

    def __post_init__(self) -> None:
        super().__post_init__()
        if not any(self.names):
            raise OptionError("names: all are empty")


def _split_channels(job: Job) -> dict[str, Any]:
    from texbake.jobs.channels import split_channel_files

    options: SplitChannelsStep = SPLIT_CHANNELS.made(job.settings)
    files = [job.outputs[name] for name in options.names if name]
    split = split_channel_files(
        job.file("image"), files, names=options.names, threads=job.threads
    ).report
    return {"width": split.width, "height": split.height}


SPLIT_CHANNELS = StepKind(
    name="split-channels",
    does="splits an image into a gray map for each channel",
    options=SplitChannelsStep,
    inputs=(Reads("image"),),
    outputs=lambda settings: {
        name: f"{name}.{settings['format']}" for name in settings["names"] if name
    },
    run=_split_channels,
    memory=channels_memory,
)

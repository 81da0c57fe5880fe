"""Gray maps packed as the channels of one image file, and image files split into gray maps.

Values are data: codes are copied, and nothing is converted between sRGB and linear. glTF packs
occlusion, roughness and metallic as red, green and blue.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from texbake.errors import OptionError, quoted
from texbake.files import PathLike, appearing_together, check_folder, check_writable
from texbake.jobs.options import PackChannelsOptions
from texbake.jobs.outputs import JobResult, check_distinct, given
from texbake.texture.image import FloatImage, Image, read_image, write_image
from texbake.texture.image_files import bits_for, suffix_like, write_images
from texbake.texture.image_formats import check_image_format, format_of

COLORS = ("red", "green", "blue", "alpha")
_LETTERS = "rgba"


@dataclass(frozen=True)
class ChannelsReport:
    """The image that `pack_channel_files` made, or that `split_channel_files` read.

    Attributes
    ----------
    width, height : int
        Texels.
    channels : tuple of str
        What each channel comes from, or goes to.
    """

    width: int
    height: int
    channels: tuple[str, ...]

    def table(self) -> list[tuple[str, str]]:
        """Return rows of a label and a figure."""
        rows = zip(COLORS, self.channels, strict=False)
        return [("size", f"{self.width} x {self.height}"), *(row for row in rows if row[1])]


def pack_channel_files(
    output: PathLike,
    red: PathLike | float,
    green: PathLike | float,
    blue: PathLike | float,
    alpha: PathLike | float | None = None,
    options: PackChannelsOptions | None = None,
    *,
    threads: int | None = None,
) -> JobResult[ChannelsReport]:
    """Pack gray maps as the channels of one image file.

    Parameters
    ----------
    output
        An image of three channels, or of four with `alpha`.
    red, green, blue, alpha
        For each channel an image file, or one value from 0 to 1 for all texels. Of an image whose
        channels differ, one is named at the end, by its letter: `orm.png:g`.
    options
        None for the defaults.
    threads
        None for every processor.

    Raises
    ------
    OptionError
        No channel is an image, the images differ in size, or a channel is not told apart.
    """
    bits = (options or PackChannelsOptions()).bits
    given_channels = [red, green, blue] if alpha is None else [red, green, blue, alpha]
    sources = [_source(value) for value in given_channels]
    files = [file for file, _ in sources if isinstance(file, Path)]
    if not files:
        raise OptionError("red, green, blue: none is an image, so there is no size to give it")
    check_distinct([output], files)
    check_writable(output)
    check_image_format(output, bits, color=False, channels=len(sources), lossless=True)
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
    return JobResult(files=given(output), report=report)


@appearing_together()
def split_channel_files(
    image: PathLike,
    output: PathLike | Sequence[PathLike],
    *,
    names: Sequence[str] | None = None,
    threads: int | None = None,
) -> JobResult[ChannelsReport]:
    """Write each channel of an image file as a gray map.

    The maps have the bits of the image. In a folder they are PNG files, unless it is one of TIFF,
    TGA or floats.

    Parameters
    ----------
    image
    output
        A folder, made if it is missing; or a file for each channel that is not left out.
    names
        What each channel is, in their order: the map of a channel called `roughness` is
        `NAME_roughness.png`, NAME being that of the image. An empty name leaves a channel out. None
        for red, green, blue and alpha, or gray and alpha.
    threads
        None for every processor.

    Raises
    ------
    OptionError
        There are more names than channels, one of them twice, or none.
    """
    files = _given_files(output)
    if files is None:
        check_folder(str(output))
    read = read_image(image, color=False, threads=threads)
    height, width, n_channels = read.pixels.shape
    gray = ("gray", "alpha")[:n_channels]
    usual = gray if n_channels < 3 else COLORS[:n_channels]
    chosen = tuple(usual if names is None else names)
    _check_names(image, chosen, n_channels)
    used = [i for i, name in enumerate(chosen) if name]
    if files is None:
        stem, suffix = Path(image).stem, suffix_like(read)
        files = [Path(str(output)) / f"{stem}_{chosen[i]}{suffix}" for i in used]
    elif len(files) != len(used):
        raise OptionError(f"output: {len(files)} files are given for {len(used)} channels")
    maps = {file: read.pixels[..., i : i + 1] for file, i in zip(files, used, strict=True)}
    check_distinct(list(maps), [image])
    bits = _bits_like(read, files[0], read.pixels)
    write_images(maps, color=False, bits=bits, threads=threads)
    return JobResult(files=tuple(maps), report=ChannelsReport(width, height, chosen))


def _given_files(output: PathLike | Sequence[PathLike]) -> list[Path] | None:
    """Return the files, or None where it is a folder for them."""
    if isinstance(output, Sequence) and not isinstance(output, str):
        return [Path(path) for path in output]
    return None


def _bits_like(image: Image, path: PathLike, pixels: FloatImage) -> int | None:
    """Return the bits that keep an image's codes, or None for the most that the format has."""
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


def _check_names(image: PathLike, names: Sequence[str], n_channels: int) -> None:
    if len(names) > n_channels:
        raise OptionError(
            f"names: {len(names)} are given, but {image} has {n_channels} "
            f"{'channel' if n_channels == 1 else 'channels'}"
        )
    used = [name for name in names if name]
    if not used:
        raise OptionError("names: all are empty, so there is nothing to write")
    for name in used:
        if used.count(name) > 1:
            raise OptionError(f"names: {name} is given twice")
        if Path(name).name != name or name in (".", ".."):
            raise OptionError(f"names: {quoted(name)} cannot be a part of a file name")

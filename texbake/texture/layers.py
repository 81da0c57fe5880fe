"""Write several images as the layers of one EXR file, and read them.

Channels are named ``layer.channel``, as in Blender and Nuke: ``normal.R``, ``displacement.Y``. All
channels are stored in one part; each layer has its own bits per channel.

Based on: Academy Software Foundation, "OpenEXR, Technical Introduction", section "Layers".
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from texbake.errors import FileFormatError, OptionError, quoted
from texbake.files import PathLike, replacing
from texbake.metadata import Value, to_description
from texbake.texture.image import Image, read_header, write_with_spec

# Names of the channels of a layer, by the number of channels.
_CHANNELS = {1: "Y", 2: "YA", 3: "RGB", 4: "RGBA"}
_ORDER = "RGBXYZUVA"  # of channels in memory; files sort them alphabetically


def write_layers(layers: Mapping[str, Image], path: PathLike) -> None:
    """Write images of one size as the layers of an EXR file."""
    import OpenImageIO as oiio  # noqa: N813

    if Path(path).suffix.lower() != ".exr":
        raise FileFormatError(f"{path}: only EXR files store layers; give a .exr file")
    _check_layers(layers, path)
    names, types, columns = [], [], []
    metadata: dict[str, Value] = {}
    for layer, image in layers.items():
        kind = "float" if image.bits == 32 else "half"
        n_channels = image.pixels.shape[2]
        names += [f"{layer}.{channel}" for channel in _CHANNELS[n_channels]]
        types += [kind] * n_channels
        columns.append(image.pixels)
        metadata |= {f"{layer}.{key}": value for key, value in image.metadata.items()}
    pixels = np.concatenate(columns, axis=2)
    height, width, n_channels = pixels.shape
    spec = oiio.ImageSpec(width, height, n_channels, "float")
    spec.channelnames = tuple(names)
    spec.channelformats = tuple(oiio.TypeDesc(kind) for kind in types)
    spec.attribute("DateTime", "")  # otherwise the time of writing
    spec.attribute("compression", "zip")
    if metadata:
        spec.attribute("ImageDescription", to_description(metadata))
    with replacing(path) as temporary:
        write_with_spec(pixels.astype(np.float32, copy=False), spec, temporary, path)


def read_layers(path: PathLike) -> dict[str, Image]:
    """Read the layers of an EXR file, in the order of their channels.

    Channels without a dot in their names form the layer "". The channels of each layer are returned
    in the order R, G, B, A, or X, Y, Z, or Y, A, whatever their order in the file.
    """
    import OpenImageIO as oiio  # noqa: N813

    metadata = read_header(path).metadata  # raises if it is not an image file
    source = oiio.ImageInput.open(str(path))
    if source is None:
        raise FileFormatError(f"{path}: it is not an image: {_one_line(oiio.geterror())}")
    spec = source.spec()
    formats = list(spec.channelformats) or [spec.format] * spec.nchannels
    pixels = source.read_image(0, 0, 0, spec.nchannels, oiio.FLOAT)
    reason = source.geterror()
    source.close()
    if pixels is None or reason:
        raise FileFormatError(f"{path}: the image is damaged: {_one_line(reason)}")
    places: dict[str, list[int]] = {}
    for place, name in enumerate(spec.channelnames):
        places.setdefault(name.rpartition(".")[0], []).append(place)
    layers = {}
    for layer, channels in places.items():
        channels.sort(key=lambda place: _rank(spec.channelnames[place]))
        half = all(str(formats[place]) == "half" for place in channels)
        prefix = f"{layer}." if layer else ""
        layers[layer] = Image(
            pixels=np.ascontiguousarray(pixels[..., channels]),
            metadata={
                key[len(prefix) :]: value
                for key, value in metadata.items()
                if key.startswith(prefix)
            },
            bits=16 if half else 32,
            name=f"{Path(path).name} ({layer})" if layer else Path(path).name,
        )
    return layers


def _rank(name: str) -> tuple[int, str]:
    channel = name.rpartition(".")[2]
    return (_ORDER.find(channel.upper()) if channel.upper() in _ORDER else len(_ORDER), channel)


def _check_layers(layers: Mapping[str, Image], path: PathLike) -> None:
    if not layers:
        raise OptionError(f"{path}: there is no layer to write; give at least one image")
    sizes = {image.pixels.shape[:2] for image in layers.values()}
    if len(sizes) > 1:
        words = ", ".join(f"{width} x {height}" for height, width in sorted(sizes))
        raise OptionError(f"{path}: its layers differ in size ({words}); bake them at one size")
    for layer, image in layers.items():
        if not layer or "." in layer:
            raise OptionError(f"{path}: {quoted(layer)} is not a layer name; use one without dots")
        if image.pixels.shape[2] not in _CHANNELS:
            raise OptionError(f"{path}: the layer {quoted(layer)} has more than four channels")
        if image.bits != 32 and np.abs(image.pixels).max() > np.finfo(np.float16).max:
            raise OptionError(
                f"{path}: the layer {quoted(layer)} is beyond half floats; give it 32 bits"
            )


def _one_line(reason: str) -> str:
    return " ".join(reason.split()) or "no reason was given"

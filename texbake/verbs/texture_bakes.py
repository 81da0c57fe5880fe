"""`bake-texture` and `bake-lightmap`: bake procedures, photographs or light into textures."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from texbake.baking.memory import PROCESS, TEXEL
from texbake.baking.options import BITS_OPTION, BakeOptions
from texbake.baking.texture.options import PhotoOptions, SolidOptions, TextureBakeOptions
from texbake.errors import OptionError, counted
from texbake.files import PathLike, make_folder
from texbake.jobs.outputs import JobResult, present_paths
from texbake.records import dataclass
from texbake.schema import Option
from texbake.verbs.step import FORMAT_OF_IMAGE, IMAGE_FORMATS, READ_FACE, n_faces, n_texels, step_of
from texbake.verbs.verb import REPORT, THREADS, Extra, Options, Reads, Writes, verb

if TYPE_CHECKING:
    from texbake.baking.texture.canvas import TextureBake, TextureReport
    from texbake.jobs.light_maps import LightMaps
    from texbake.progress import Progress

_CAMERA_SUFFIXES = (".toml", ".txt")
_SOLID = ("procedure", "param", "volume", "scale", "colors")
_PHOTO = ("photos", "cameras", "max_angle", "falloff", "feather", "margin", "occlusion")


def _with_options(values: dict[str, Any]) -> dict[str, Any]:
    """Return the options of the requested bake: a procedure or photographs."""
    files = ("mesh", "output", "data", "bits", "unseen_map", "report", "photos", "cameras")
    rest = dict(values)
    arguments = {name: rest.pop(name) for name in files}
    photos = arguments["photos"]
    solid = {name: rest.pop(name) for name in _SOLID}
    cast = {name: rest.pop(name) for name in _PHOTO if name in rest}
    if sum((solid["procedure"] is not None, bool(solid["volume"]), bool(photos))) != 1:
        raise OptionError("procedure, volume, photos: give a procedure, a volume or photographs")
    if photos:
        return {**arguments, "options": PhotoOptions(**cast, **rest)}
    options = SolidOptions(
        procedure=solid["procedure"] or SolidOptions.procedure,
        volume=solid["volume"],
        parameters=dict(map(_parameter, solid["param"])),
        scale=solid["scale"],
        colors=None if solid["colors"] is None else _ramp(solid["colors"]),
        **rest,
    )
    return {**arguments, "options": options}


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
    from texbake.texture.encoding import decode_srgb

    colors = []
    for word in text.split(","):
        digits = word.strip().removeprefix("#")
        try:
            codes = bytes.fromhex(digits)
        except ValueError:
            codes = b""
        if len(codes) != 3:
            raise OptionError(f"colors: {word!r} is not a color such as #c89a5b")
        red, green, blue = decode_srgb([code / 255.0 for code in codes]).tolist()
        colors.append((red, green, blue))
    return tuple(colors)


@verb(
    Reads("mesh"),
    Writes("output", "image", "The texture."),
    Options(SolidOptions, "procedure", apart=True, unset=True),
    Extra(
        "--param",
        "Set a parameter of the procedure; repeatable.",
        multiple=True,
        metavar="KEY=VALUE",
    ),
    Options(SolidOptions, "volume", "scale", "colors", apart=True),
    Extra("--data", "Treat the values as data, such as roughness, not as colors.", is_flag=True),
    Reads(
        "photos", "image", "A photograph of the object; repeatable.", flags=("--photo",),
        required=False, many=True, role=None,
    ),
    Reads(
        "cameras", "camera",
        "Where each photograph was taken from, in their order: a TOML file with position, target, "
        "up, fov and aspect, a text file with a 4 x 4 matrix, or a mesh of the same faces whose "
        "texture coordinates are positions in the photograph.",
        flags=("--camera", "--photo-uvs"), required=False, many=True, role=None, metavar="FILE",
    ),
    Options(PhotoOptions, "max_angle", "falloff", "feather", "margin", "occlusion", apart=True),
    Options(TextureBakeOptions, without=("threads",), apart=True),
    Options(BakeOptions, "bits", apart=True),
    Writes("unseen_map", "picture", "Also draw which texels no photograph shows."),
    REPORT,
    THREADS,
    sections={"A solid procedure": _SOLID, "Photographs": _PHOTO},
    common=("procedure", "param", "photos", "cameras"),
    examples="""
      texbake bake-texture bust.obj -o marble.png --procedure marble --param amount=5
      texbake bake-texture vase.obj -o wood.png --procedure wood --colors "#2b1a10,#c89a5b"
      texbake bake-texture a.obj -o t.png --photo a.jpg --camera a.txt --photo b.png --camera b.txt
      texbake bake-texture head.obj -o head.png --photo left.jpg --photo-uvs left.obj
    """,
    prepare=_with_options,
)  # fmt: skip
def bake_texture_files(
    mesh: PathLike,
    output: PathLike,
    options: SolidOptions | PhotoOptions,
    *,
    photos: Sequence[PathLike] = (),
    cameras: Sequence[PathLike] = (),
    data: bool = False,
    bits: int | None = None,
    unseen_map: PathLike | None = None,
    report: PathLike | None = None,
    progress: Progress = None,
) -> JobResult[TextureReport]:
    """Bake a procedure or photographs into a texture.

    A solid procedure or a volume has no seams, because it is evaluated in space. Photographs are
    blended by how well each shows a point. Texels that no photograph shows are filled from the
    texels around them and reported.
    """
    from texbake.texture.image import write_image
    from texbake.texture.image_formats import check_image_format

    _check_sources(options, photos, cameras)
    check_image_format(output, bits)
    result = _baked(mesh, options, photos, cameras, progress)
    result.write(output, color=not data, bits=bits)
    if unseen_map is not None:
        write_image(result.unseen_map(), unseen_map)
    return JobResult(
        files=present_paths(output, unseen_map),
        report=result.report,
        warnings=tuple(result.report.warnings),
    )


def _check_sources(
    options: SolidOptions | PhotoOptions, photos: Sequence[PathLike], cameras: Sequence[PathLike]
) -> None:
    if isinstance(options, SolidOptions):
        if photos or cameras:
            raise OptionError("cameras: each goes with `photos`; a procedure has none")
    elif not photos:
        raise OptionError("photos: there are none; give at least one, or SolidOptions")
    elif len(photos) != len(cameras):
        raise OptionError(
            f"cameras: {counted(len(cameras), 'is', 'are')} given for "
            f"{counted(len(photos), 'photograph')}; give one for each, in their order"
        )


def _baked(
    mesh: PathLike,
    options: SolidOptions | PhotoOptions,
    photos: Sequence[PathLike],
    cameras: Sequence[PathLike],
    progress: Progress,
) -> TextureBake:
    from texbake.baking.texture.photos import Photo, bake_photos, read_camera
    from texbake.baking.texture.solid import bake_solid
    from texbake.mesh.files import read_mesh

    target = read_mesh(mesh, progress=progress)
    if isinstance(options, SolidOptions):
        return bake_solid(target, options, progress=progress)
    sources = []
    for image, file in zip(photos, cameras, strict=True):
        if Path(file).suffix.lower() in _CAMERA_SUFFIXES:
            sources.append(Photo(image=image, camera=read_camera(file)))
        else:
            sources.append(Photo(image=image, mapped=read_mesh(file, progress=progress)))
    return bake_photos(target, sources, options, progress=progress)


@dataclass(frozen=True, kw_only=True)
class BakeTextureStep(SolidOptions):
    """How a texture is baked; further options are those of `SolidOptions`."""

    data: Annotated[bool, Option("Treat the values as data, such as roughness, not as colors.")] = (
        False
    )
    bits: Annotated[int | None, BITS_OPTION] = None
    format: Annotated[str, FORMAT_OF_IMAGE] = "png"


STEP = step_of(
    bake_texture_files,
    does="bakes a procedure, such as marble, into a texture",
    options=BakeTextureStep,
    outputs=lambda settings: {"texture": f"texture.{settings['format']}"},
    figures=lambda result: {"notes": list(result.warnings)},
    memory=lambda settings, sizes: (
        PROCESS + READ_FACE * n_faces(sizes, "mesh") + TEXEL * n_texels(settings)
    ),
)


@verb(
    Reads("scene", "scene"),
    Writes("output", "folder", "Folder of the maps, which is made if it is missing."),
    Options(BakeOptions, "size"),
    Options(TextureBakeOptions, "samples", defaults={"samples": BakeOptions.samples}, apart=True),
    Extra(
        "--format",
        "File format of the maps; exr and tif store light as floats.",
        choices=IMAGE_FORMATS,
        default="exr",
        show_default=True,
    ),
    Extra(
        "--uv-set uv_set",
        "Texture coordinates of the maps, for objects that have them; see: texbake unwrap "
        "--uv-set.  [default: the first]",
        metavar="NAME",
    ),
    Options(BakeOptions, "bits", "padding", "fill", "threads"),
    examples="""
      texbake bake-lightmap room.toml -o maps --size 512 --samples 16
    """,
)
def bake_lightmap(
    scene: PathLike,
    output: PathLike,
    options: BakeOptions,
    *,
    format: str = "exr",  # noqa: A002
    uv_set: str | None = None,
    progress: Progress = None,
) -> JobResult[LightMaps]:
    """Bake the static lights of SCENE into light maps.

    A light map contains the ambient light and the static lights with their shadows. Every object
    that has texture coordinates gets one, which has the object's name.
    """
    from texbake.jobs.light_maps import bake_light_maps, file_names, light_map_images
    from texbake.jobs.outputs import check_distinct
    from texbake.progress import Stages
    from texbake.rendering.scene.read import read_scene
    from texbake.texture.image_formats import check_image_format

    folder = Path(output)
    check_image_format(folder / f"map.{format}", options.bits, channels=3)
    stages = Stages(progress)
    with stages.part("read scene"):
        read = read_scene(scene, progress=progress)
    baked = bake_light_maps(read, options, uv_set=uv_set, progress=progress)
    with stages.stage("write maps"):
        make_folder(folder)
        names = file_names([item.name for item in baked.maps])
        files = [folder / f"{name}.{format}" for name in names]
        check_distinct(files, [path for path in read.files if path not in light_map_images(read)])
        for item, path in zip(baked.maps, files, strict=True):
            item.write(path, bits=options.bits, threads=options.threads)
    return JobResult(files=tuple(files), report=baked, warnings=baked.warnings)

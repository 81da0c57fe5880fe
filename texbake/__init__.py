"""Unwrap meshes, bake normal and displacement maps, and preview them.

>>> import texbake
>>> high = texbake.read_mesh("high.ply")  # doctest: +SKIP
>>> low = texbake.unwrap(texbake.simplify(high, 500))  # doctest: +SKIP
>>> texbake.bake(high, low).write("maps/")  # doctest: +SKIP

Names are loaded when they are first used, so that importing the package costs next to nothing.
"""

from __future__ import annotations

import sys
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any

from texbake.public_names import NAMES as _NAMES

__version__ = "0.1.0"

if TYPE_CHECKING:
    from texbake.baking.bake import bake, remap, remap_hits
    from texbake.baking.baked_map import BakedMap, WrittenMap
    from texbake.baking.cage.fit import Cage, fit_cage
    from texbake.baking.hits_file import read_hits, write_hits
    from texbake.baking.options import BakeOptions
    from texbake.baking.parts.bake_parts import bake_parts, match_parts
    from texbake.baking.parts.light import Canvas
    from texbake.baking.parts.options import PartsOptions
    from texbake.baking.parts.result import PartsResult
    from texbake.baking.ray_maps import RayMaps
    from texbake.baking.report import BakeReport
    from texbake.baking.result import BakeResult
    from texbake.baking.texture.camera import PhotoCamera
    from texbake.baking.texture.options import PhotoOptions, SolidOptions
    from texbake.baking.texture.photo import Photo
    from texbake.baking.texture.photos import bake_photos
    from texbake.baking.texture.result import TextureBake, TextureReport
    from texbake.baking.texture.solid import bake_solid
    from texbake.building.build import build, plan_build
    from texbake.building.options import BuildOptions
    from texbake.building.report import BuildResult
    from texbake.building.watch import watch
    from texbake.checks.check import check, check_files
    from texbake.checks.finding import Finding
    from texbake.checks.options import CheckOptions
    from texbake.checks.report import CheckReport
    from texbake.errors import (
        CageError,
        DependencyError,
        FileError,
        FileFormatError,
        MeshError,
        MissError,
        OptionError,
        TexbakeError,
        UnwrapError,
        UvError,
    )
    from texbake.jobs.check_picture import render_findings
    from texbake.jobs.checker import render_checker
    from texbake.jobs.demo import demo
    from texbake.jobs.export.export import ExportResult, export_asset
    from texbake.jobs.export.options import ExportOptions
    from texbake.jobs.layout import write_layout
    from texbake.jobs.light_map import LightMaps, bake_light_maps
    from texbake.jobs.options import DemoOptions, RunOptions
    from texbake.jobs.run import RunResult, run
    from texbake.mapping.distortion import Distortion, distortion
    from texbake.mapping.layout import draw_layout
    from texbake.mapping.layout_svg import layout_svg
    from texbake.mapping.options import UnwrapOptions
    from texbake.mapping.unwrap import unwrap, unwrap_together, unwrap_with_report
    from texbake.mapping.unwrap_report import UnwrapReport
    from texbake.mesh.curvature import vertex_curvatures
    from texbake.mesh.distance import SurfaceDistance, surface_distance
    from texbake.mesh.files import read_mesh, write_mesh
    from texbake.mesh.info import MeshInfo, mesh_info
    from texbake.mesh.materials import BaseColor, Materials, read_materials
    from texbake.mesh.mesh import Mesh
    from texbake.mesh.parametric.make import make
    from texbake.mesh.parametric.options import MakeOptions
    from texbake.mesh.simplify import SimplifyReport, simplify, simplify_with_report
    from texbake.mesh.tangents import corner_tangents
    from texbake.pages.bake_page import write_bake_page
    from texbake.rendering.camera import Camera
    from texbake.rendering.compare import Closeness, Comparison, compare
    from texbake.rendering.options import RenderOptions
    from texbake.rendering.picture_report import PictureBudget, PictureSampling
    from texbake.rendering.plan.plan import Plan
    from texbake.rendering.render import plan_scene, render, render_scene
    from texbake.rendering.resolve import Frame
    from texbake.rendering.scene.lights import (
        Ambient,
        AmbientOcclusion,
        Environment,
        Fog,
        Light,
        Lighting,
        Shadow,
    )
    from texbake.rendering.scene.material import (
        BumpMap,
        Displacement,
        Material,
        NormalMap,
        Parallax,
        ProjectedTexture,
        Reflection,
        Refraction,
    )
    from texbake.rendering.scene.read import read_scene
    from texbake.rendering.scene.scene import Scene, SceneObject, View
    from texbake.rendering.scene.textures import ImageTexture, ProcedureTexture
    from texbake.study.options import StudyOptions
    from texbake.study.result import StudyResult
    from texbake.study.study import study
    from texbake.study.write import write_study
    from texbake.texture.checker import checker_image
    from texbake.texture.cube_lookup import sample_cube
    from texbake.texture.cube_map import CubeMap
    from texbake.texture.height_options import HeightToNormalOptions, NormalToHeightOptions
    from texbake.texture.height_to_normal import height_to_normal
    from texbake.texture.image import Image, read_image, write_image
    from texbake.texture.latitude_longitude import from_latitude_longitude, to_latitude_longitude
    from texbake.texture.mipmaps import MipChain, mip_chain
    from texbake.texture.normal_to_height import HeightField, normal_to_height
    from texbake.texture.pack import PackedTextures, pack_textures
    from texbake.texture.pack_options import PackOptions
    from texbake.texture.ramp import ramp_lookup
    from texbake.texture.sample import sample_texture
    from texbake.texture.volume import volume_lookup

_HOMES = {name: module for module, names in _NAMES.items() for name in names}

__all__ = [
    "Ambient",
    "AmbientOcclusion",
    "BakeOptions",
    "BakeReport",
    "BakeResult",
    "BakedMap",
    "BaseColor",
    "BuildOptions",
    "BuildResult",
    "BumpMap",
    "Cage",
    "CageError",
    "Camera",
    "Canvas",
    "CheckOptions",
    "CheckReport",
    "Closeness",
    "Comparison",
    "CubeMap",
    "DemoOptions",
    "DependencyError",
    "Displacement",
    "Distortion",
    "Environment",
    "ExportOptions",
    "ExportResult",
    "FileError",
    "FileFormatError",
    "Finding",
    "Fog",
    "Frame",
    "HeightField",
    "HeightToNormalOptions",
    "Image",
    "ImageTexture",
    "Light",
    "LightMaps",
    "Lighting",
    "MakeOptions",
    "Material",
    "Materials",
    "Mesh",
    "MeshError",
    "MeshInfo",
    "MipChain",
    "MissError",
    "NormalMap",
    "NormalToHeightOptions",
    "OptionError",
    "PackOptions",
    "PackedTextures",
    "Parallax",
    "PartsOptions",
    "PartsResult",
    "Photo",
    "PhotoCamera",
    "PhotoOptions",
    "PictureBudget",
    "PictureSampling",
    "Plan",
    "ProcedureTexture",
    "ProjectedTexture",
    "RayMaps",
    "Reflection",
    "Refraction",
    "RenderOptions",
    "RunOptions",
    "RunResult",
    "Scene",
    "SceneObject",
    "Shadow",
    "SimplifyReport",
    "SolidOptions",
    "StudyOptions",
    "StudyResult",
    "SurfaceDistance",
    "TexbakeError",
    "TextureBake",
    "TextureReport",
    "UnwrapError",
    "UnwrapOptions",
    "UnwrapReport",
    "UvError",
    "View",
    "WrittenMap",
    "__version__",
    "bake",
    "bake_light_maps",
    "bake_parts",
    "bake_photos",
    "bake_solid",
    "build",
    "check",
    "check_files",
    "checker_image",
    "compare",
    "corner_tangents",
    "demo",
    "distortion",
    "draw_layout",
    "export_asset",
    "fit_cage",
    "from_latitude_longitude",
    "height_to_normal",
    "layout_svg",
    "make",
    "match_parts",
    "mesh_info",
    "mip_chain",
    "normal_to_height",
    "pack_textures",
    "plan_build",
    "plan_scene",
    "ramp_lookup",
    "read_hits",
    "read_image",
    "read_materials",
    "read_mesh",
    "read_scene",
    "remap",
    "remap_hits",
    "render",
    "render_checker",
    "render_findings",
    "render_scene",
    "run",
    "sample_cube",
    "sample_texture",
    "simplify",
    "simplify_with_report",
    "study",
    "surface_distance",
    "to_latitude_longitude",
    "unwrap",
    "unwrap_together",
    "unwrap_with_report",
    "vertex_curvatures",
    "volume_lookup",
    "watch",
    "write_bake_page",
    "write_hits",
    "write_image",
    "write_layout",
    "write_mesh",
    "write_study",
]


class _Package(ModuleType):
    """The package itself, in which `bake`, `check` and `render` are functions and not the rooms.

    The import system sets a package's attribute to each subpackage that it loads, which would hide
    a function of the same name from then on.
    """

    def __setattr__(self, name: str, value: object) -> None:
        if not (name in _HOMES and isinstance(value, ModuleType)):
            super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'texbake' has no attribute {name!r}")
    value = getattr(import_module(_HOMES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)

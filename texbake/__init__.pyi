"""The only list of the public names of the package; each is loaded when it is first used."""

from .baking.atlas_points import AtlasPoints as AtlasPoints, atlas_points as atlas_points
from .baking.bake import bake as bake, remap as remap
from .baking.cage import fit_cage as fit_cage
from .baking.options import BakeOptions as BakeOptions
from .baking.parts.bake_parts import bake_parts as bake_parts
from .baking.parts.matching import PartsOptions as PartsOptions
from .building.build import build as build
from .building.options import BuildOptions as BuildOptions
from .checks.check import check as check
from .checks.kinds import CheckOptions as CheckOptions
from .errors import (
    FileError as FileError,
    OptionError as OptionError,
    ReadWarning as ReadWarning,
    TexbakeError as TexbakeError,
)
from .jobs.finish import Finished as Finished, finish as finish
from .jobs.light_maps import bake_light_maps as bake_light_maps
from .jobs.options import RunOptions as RunOptions
from .jobs.run import run as run
from .mapping.distortion import distortion as distortion
from .mapping.layout import draw_layout as draw_layout
from .mapping.options import UnwrapOptions as UnwrapOptions
from .mapping.parametrize import parametrize as parametrize
from .mapping.unwrap import unwrap as unwrap
from .mesh.distance import surface_distance as surface_distance
from .mesh.files import read_mesh as read_mesh, write_mesh as write_mesh
from .mesh.info import mesh_info as mesh_info
from .mesh.interchange import from_trimesh as from_trimesh, to_trimesh as to_trimesh
from .mesh.mesh import Mesh as Mesh
from .mesh.options import (
    RemeshOptions as RemeshOptions,
    RepairOptions as RepairOptions,
    SimplifyOptions as SimplifyOptions,
    TransformOptions as TransformOptions,
)
from .mesh.parametric.make import make as make
from .mesh.parametric.options import MakeOptions as MakeOptions
from .mesh.remesh import remesh as remesh
from .mesh.repair import repair as repair
from .mesh.simplify import simplify as simplify
from .mesh.transform import transform as transform
from .pages.show import show as show
from .rendering.compare import compare as compare
from .rendering.options import RenderOptions as RenderOptions
from .rendering.render import render as render, render_scene as render_scene
from .rendering.scene.lights import Ambient as Ambient, Light as Light, Lighting as Lighting
from .rendering.scene.material import Material as Material
from .rendering.scene.read import read_scene as read_scene
from .rendering.scene.scene import (
    CameraView as CameraView,
    Scene as Scene,
    SceneObject as SceneObject,
)
from .rendering.scene.textures import ImageTexture as ImageTexture
from .texture.checker import checker_image as checker_image
from .texture.heights_and_normals import (
    height_to_normal as height_to_normal,
    normal_to_height as normal_to_height,
)
from .texture.image import read_image as read_image, write_image as write_image
from .texture.model_materials import read_materials as read_materials
from .texture.options import (
    HeightToNormalOptions as HeightToNormalOptions,
    NormalToHeightOptions as NormalToHeightOptions,
)
from .texture.padding import fill as fill

__version__: str

"""The only list of the public names of the package; each is loaded when it is first used."""

from .baking.bake import bake as bake
from .baking.cage import (
    Cage as Cage,
    fit_cage as fit_cage,
)
from .baking.hits_file import (
    read_hits as read_hits,
    write_hits as write_hits,
)
from .baking.options import BakeOptions as BakeOptions
from .baking.parts.bake_parts import bake_parts as bake_parts
from .baking.parts.high_parts import match_parts as match_parts
from .baking.parts.low_parts import BakeTarget as BakeTarget
from .baking.parts.options import PartsOptions as PartsOptions
from .baking.parts.result import PartsResult as PartsResult
from .baking.rays import RayMaps as RayMaps
from .baking.remap import remap as remap, remap_hits as remap_hits
from .baking.report import BakeReport as BakeReport
from .baking.result import BakedMap as BakedMap, BakeResult as BakeResult, WrittenMap as WrittenMap
from .baking.texture.options import (
    PhotoOptions as PhotoOptions,
    SolidOptions as SolidOptions,
    TextureBakeOptions as TextureBakeOptions,
)
from .baking.texture.photo import Photo as Photo, PhotoCamera as PhotoCamera
from .baking.texture.photos import bake_photos as bake_photos
from .baking.texture.result import (
    TextureBake as TextureBake,
    TextureReport as TextureReport,
)
from .baking.texture.solid import bake_solid as bake_solid
from .building.build import (
    PlannedStep as PlannedStep,
    build as build,
    plan_build as plan_build,
)
from .building.options import BuildOptions as BuildOptions
from .building.progress import (
    BuildEvent as BuildEvent,
    BuildListener as BuildListener,
)
from .building.report import BuildResult as BuildResult
from .building.schema import pipeline_schema as pipeline_schema, schema_file as schema_file
from .building.watch import watch as watch
from .checks.check import (
    check as check,
    check_files as check_files,
)
from .checks.finding import Finding as Finding
from .checks.options import SEVERITIES as SEVERITIES, CheckOptions as CheckOptions
from .checks.report import CheckReport as CheckReport
from .errors import (
    CageError as CageError,
    DependencyError as DependencyError,
    FileError as FileError,
    FileFormatError as FileFormatError,
    MeshError as MeshError,
    MissError as MissError,
    OptionError as OptionError,
    ReadWarning as ReadWarning,
    TexbakeError as TexbakeError,
    UnwrapError as UnwrapError,
    UvError as UvError,
    heard_warnings as heard_warnings,
    is_out_of_memory as is_out_of_memory,
)
from .jobs.check_meshes import (
    check_mesh_files as check_mesh_files,
    render_findings as render_findings,
)
from .jobs.comparison import (
    compare_files as compare_files,
    comparison_table as comparison_table,
)
from .jobs.demo import demo as demo
from .jobs.export.export import (
    ExportResult as ExportResult,
    export_asset as export_asset,
)
from .jobs.export.options import ExportOptions as ExportOptions
from .jobs.light_maps import (
    LightMaps as LightMaps,
    bake_light_map_files as bake_light_map_files,
    bake_light_maps as bake_light_maps,
)
from .jobs.lighten import LightenReport as LightenReport
from .jobs.lighten_options import LightenOptions as LightenOptions
from .jobs.maps import (
    MapFiles as MapFiles,
    bake_files as bake_files,
)
from .jobs.meshes import (
    MeshFileInfo as MeshFileInfo,
    info_file as info_file,
)
from .jobs.options import (
    DEMO_FOLDER as DEMO_FOLDER,
    DemoOptions as DemoOptions,
    PackChannelsOptions as PackChannelsOptions,
    RunOptions as RunOptions,
)
from .jobs.outputs import JobResult as JobResult
from .jobs.parts import (
    PartsFiles as PartsFiles,
    bake_parts_files as bake_parts_files,
    match_parts_files as match_parts_files,
    needs_parts as needs_parts,
)
from .jobs.preview import (
    PreviewFiles as PreviewFiles,
    preview_files as preview_files,
)
from .jobs.run import (
    RunResult as RunResult,
    run as run,
    run_files as run_files,
)
from .jobs.uv_pictures import (
    render_checker as render_checker,
    write_layout as write_layout,
)
from .limits import (
    raised_limits as raised_limits,
    whole_number as whole_number,
)
from .mapping.classical.projector import read_matrix as read_matrix
from .mapping.distortion import (
    Distortion as Distortion,
    distortion as distortion,
)
from .mapping.layout import draw_layout as draw_layout
from .mapping.layout_svg import layout_svg as layout_svg
from .mapping.options import UnwrapOptions as UnwrapOptions
from .mapping.parametrize import parametrize as parametrize
from .mapping.unwrap import (
    UnwrapReport as UnwrapReport,
    unwrap as unwrap,
    unwrap_together as unwrap_together,
    unwrap_with_report as unwrap_with_report,
)
from .mesh.distance import (
    SurfaceDistance as SurfaceDistance,
    surface_distance as surface_distance,
)
from .mesh.files import (
    MESH_SUFFIXES as MESH_SUFFIXES,
    WRITABLE_MESH_SUFFIXES as WRITABLE_MESH_SUFFIXES,
    read_mesh as read_mesh,
    write_mesh as write_mesh,
)
from .mesh.hard_edges import with_normals as with_normals
from .mesh.info import (
    MeshInfo as MeshInfo,
    mesh_info as mesh_info,
)
from .mesh.interchange import (
    MeshLike as MeshLike,
    from_trimesh as from_trimesh,
    to_trimesh as to_trimesh,
)
from .mesh.materials import (
    CHANNELS as CHANNELS,
    Channel as Channel,
    ChannelImage as ChannelImage,
    ChannelSource as ChannelSource,
    Materials as Materials,
    MeshMaterial as MeshMaterial,
)
from .mesh.mesh import Mesh as Mesh
from .mesh.normals import vertex_curvatures as vertex_curvatures
from .mesh.options import RepairOptions as RepairOptions, TransformOptions as TransformOptions
from .mesh.parametric.make import make as make
from .mesh.parametric.options import SHAPES as SHAPES, MakeOptions as MakeOptions
from .mesh.remesh import (
    remesh as remesh,
    remesh_with_report as remesh_with_report,
)
from .mesh.remesh_options import RemeshOptions as RemeshOptions
from .mesh.remesh_report import RemeshReport as RemeshReport
from .mesh.repair import (
    RepairReport as RepairReport,
    repair as repair,
)
from .mesh.simplify import (
    SimplifyReport as SimplifyReport,
    simplify as simplify,
    simplify_with_report as simplify_with_report,
)
from .mesh.simplify_options import SimplifyOptions as SimplifyOptions
from .mesh.tangents import corner_tangents as corner_tangents
from .mesh.transform import transform as transform
from .pages.asset_page import write_bake_page as write_bake_page
from .pages.slider_page import write_slider_page as write_slider_page
from .progress import ProgressSink as ProgressSink
from .rendering.camera import Camera as Camera
from .rendering.compare import (
    Closeness as Closeness,
    Comparison as Comparison,
    compare as compare,
)
from .rendering.compare_models import (
    ModelComparison as ModelComparison,
    compare_models as compare_models,
)
from .rendering.effect import Plan as Plan
from .rendering.options import RenderOptions as RenderOptions
from .rendering.render import (
    plan_scene as plan_scene,
    render as render,
    render_scene as render_scene,
)
from .rendering.resolve import Frame as Frame
from .rendering.scene.file.schema import scene_schema as scene_schema
from .rendering.scene.lights import (
    Ambient as Ambient,
    AmbientOcclusion as AmbientOcclusion,
    Environment as Environment,
    Fog as Fog,
    Light as Light,
    Lighting as Lighting,
    Shadow as Shadow,
)
from .rendering.scene.material import (
    BumpMap as BumpMap,
    Displacement as Displacement,
    Material as Material,
    NormalMap as NormalMap,
    Parallax as Parallax,
    ProjectedTexture as ProjectedTexture,
    Reflection as Reflection,
    Refraction as Refraction,
)
from .rendering.scene.read import read_scene as read_scene
from .rendering.scene.scene import (
    CameraView as CameraView,
    Scene as Scene,
    SceneObject as SceneObject,
)
from .rendering.scene.textures import (
    ImageTexture as ImageTexture,
    ProcedureTexture as ProcedureTexture,
)
from .sampling.report import SamplingReport as SamplingReport
from .sampling.time_budget import (
    BudgetClock as BudgetClock,
    TimeBudget as TimeBudget,
)
from .schema import (
    Option as Option,
    OptionField as OptionField,
    option_field as option_field,
    option_fields as option_fields,
)
from .study.bench.job import (
    bench_files as bench_files,
    bench_rows as bench_rows,
)
from .study.bench.options import BenchOptions as BenchOptions
from .study.bench.result import BenchResult as BenchResult
from .study.bench.run import run_bench as run_bench
from .study.bench.write import write_bench as write_bench
from .study.job import (
    study_files as study_files,
    study_rows as study_rows,
)
from .study.options import StudyOptions as StudyOptions
from .study.result import StudyResult as StudyResult
from .study.study import run_study as run_study
from .study.write import write_study as write_study
from .texture.checker import checker_image as checker_image
from .texture.cube_lookup import (
    from_latitude_longitude as from_latitude_longitude,
    sample_cube as sample_cube,
    to_latitude_longitude as to_latitude_longitude,
)
from .texture.cube_map import CubeMap as CubeMap
from .texture.encoding import decode_srgb as decode_srgb
from .texture.gltf_images import gltf_images as gltf_images
from .texture.height_options import (
    HeightToNormalOptions as HeightToNormalOptions,
    NormalToHeightOptions as NormalToHeightOptions,
)
from .texture.heights_and_normals import (
    HeightField as HeightField,
    height_to_normal as height_to_normal,
    normal_to_height as normal_to_height,
)
from .texture.image import (
    Image as Image,
    read_image as read_image,
    write_image as write_image,
)
from .texture.lookup import ramp_lookup as ramp_lookup, volume_lookup as volume_lookup
from .texture.mipmaps import (
    MipChain as MipChain,
    mip_chain as mip_chain,
)
from .texture.model_materials import read_materials as read_materials
from .texture.options import (
    CubeOptions as CubeOptions,
    MipOptions as MipOptions,
    PackOptions as PackOptions,
)
from .texture.pack import (
    PackedTextures as PackedTextures,
    pack_textures as pack_textures,
)
from .texture.sample import sample_texture as sample_texture
from .verbs.bake_texture import bake_texture_files as bake_texture_files
from .verbs.cage import cage_file as cage_file
from .verbs.cubemap import cubemap_files as cubemap_files
from .verbs.export import export_files as export_files
from .verbs.height_to_normal import height_to_normal_file as height_to_normal_file
from .verbs.lighten import lighten_file as lighten_file
from .verbs.make import (
    Relief as Relief,
    make_file as make_file,
)
from .verbs.mipmap import mipmap_files as mipmap_files
from .verbs.normal_to_height import normal_to_height_file as normal_to_height_file
from .verbs.pack_channels import (
    ChannelsReport as ChannelsReport,
    pack_channel_files as pack_channel_files,
)
from .verbs.pack_textures import pack_texture_files as pack_texture_files
from .verbs.remap import remap_files as remap_files
from .verbs.remesh import remesh_file as remesh_file
from .verbs.repair import repair_file as repair_file
from .verbs.simplify import (
    simplify_file as simplify_file,
    simplify_levels as simplify_levels,
)
from .verbs.split_channels import split_channel_files as split_channel_files
from .verbs.transform import transform_file as transform_file
from .verbs.unwrap import (
    UnwrapFiles as UnwrapFiles,
    unwrap_files as unwrap_files,
)

__version__: str

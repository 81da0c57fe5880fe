"""Every option of a study and of the bench, with its default."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from texbake.errors import OptionError
from texbake.records import dataclass
from texbake.schema import THREADS_OPTION, CheckedOptions, Option, option

# In the order in which they are studied and shown, each with its module in `knobs`.
KNOB_MODULES = {
    "texture-size": "baked_maps",
    "samples": "baked_maps",
    "bit-depth": "baked_maps",
    "map-kind": "baked_maps",
    "ray-direction": "low_poly_mesh",
    "low-poly": "low_poly_mesh",
    "atlas-quality": "low_poly_mesh",
    "bump-gradient": "bumps",
    "bump-form": "bumps",
    "bump-light": "bumps",
    "surface-detail": "displacement",
    "tessellation": "displacement",
    "texture-lookup": "textures",
    "interpolation": "textures",
    "environment": "lighting",
    "shadow-map": "lighting",
    "noise": "textures",
}
KNOB_NAMES = tuple(KNOB_MODULES)

REPEATS_OPTION = Option("Number of timed runs of each setting.", metavar="N", low=1)
SECONDS_OPTION = Option(
    "Seconds after which a setting is not run again, once it has been run twice.",
    metavar="S",
    low=0,
    unit="seconds",
)


@dataclass(frozen=True, kw_only=True)
class StudyOptions(CheckedOptions):
    """Which settings a study measures, and how often.

    Besides its timed runs each setting has a first one, which only counts where it alone takes
    longer than `seconds`.
    """

    knobs: tuple[str, ...] = option(
        KNOB_NAMES,
        "Setting to study; repeatable.",
        choices=KNOB_NAMES,
        metavar="NAME",
        default="all",
        flag="--knob",
        many=True,
    )
    repeats: int = option(5, REPEATS_OPTION)
    seconds: float = option(10.0, SECONDS_OPTION)
    quick: bool = option(False, "Study a small range of each setting on small meshes, in a minute.")
    threads: int | None = option(None, THREADS_OPTION)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.knobs:
            raise OptionError("knobs: none is named; name at least one, or leave it out for all")

    @property
    def ordered_knobs(self) -> tuple[str, ...]:
        """Knobs to study, each once, in the order of `KNOB_NAMES`."""
        return in_order(self.knobs, KNOB_NAMES)


def in_order(names: Collection[str], known: Sequence[str]) -> tuple[str, ...]:
    """Return names that a user gave, each once, in the order of all names."""
    return tuple(name for name in known if name in names)


# Of the bench, in the order in which they are run and shown.
TASK_NAMES = (
    "bake-normals",
    "bake-displacement",
    "bake-ao",
    "unwrap",
    "simplify",
    "remesh",
    "preview",
)
CASE_NAMES = (
    "sphere",
    "displaced-sphere",
    "orange",
    "gyroid",
    "hard-edges",
    "terrain",
    "thin-shells",
    "mirrored-uvs",
    "two-parts",
)
PROGRAM_NAMES = (
    "texbake",
    "blender",
    "pymeshlab",
    "xatlas",
    "fast-simplification",
    "meshoptimizer",
)

MAX_SIZE, MAX_TRIANGLES = 16384, 100_000_000

# Names the Python of Blender where the option does not.
BLENDER_VARIABLE = "TEXBAKE_BLENDER_PYTHON"


@dataclass(frozen=True, kw_only=True)
class Amounts:
    """What is tried beside sizes, and how much of it."""

    samples: tuple[int, ...] = (1, 4, 16)  # per texel
    rays: tuple[int, ...] = (16, 64, 256)  # of ambient occlusion, per texel
    counts: tuple[int, ...] = (500, 5_000, 50_000)  # of triangles to simplify to
    voxels: tuple[int, ...] = (64, 128, 256, 512)  # along the longest side of a new mesh
    pixel_samples: tuple[int, ...] = (1, 4, 16)  # per pixel of a picture
    unwrapped_triangles: int = 10_000  # of a generated mesh that is unwrapped
    picture_size: int = 512  # pixels along one side of a picture
    n_probes: int = 100_000  # points at which maps and surfaces are compared with the truth


QUICK = Amounts(
    samples=(1, 4), rays=(16,), counts=(100,), voxels=(24,), pixel_samples=(1, 4),
    unwrapped_triangles=500, picture_size=48, n_probes=3_000,
)  # fmt: skip
_QUICK_TRIANGLES = 4_000
_QUICK_TIMEOUT = 60.0


@dataclass(frozen=True, kw_only=True)
class BenchOptions(CheckedOptions):
    """What the bench runs, on what, and how often."""

    tasks: tuple[str, ...] = option(
        TASK_NAMES,
        "Task to run; repeatable.",
        choices=TASK_NAMES,
        metavar="NAME",
        default="all",
        flag="--task",
        many=True,
    )
    cases: tuple[str, ...] = option(
        CASE_NAMES,
        "Generated mesh to run them on; repeatable.",
        choices=CASE_NAMES,
        metavar="NAME",
        default="all, or none with meshes of your own",
        flag="--case",
        many=True,
    )
    programs: tuple[str, ...] = option(
        PROGRAM_NAMES,
        "Program to run; repeatable.",
        choices=PROGRAM_NAMES,
        metavar="NAME",
        default="all that are installed",
        flag="--program",
        many=True,
    )
    sizes: tuple[int, ...] = option(
        (512, 1024, 2048, 4096),
        "Width of baked maps, which are square; repeatable.",
        metavar="PX",
        unit="texels",
        default="512, 1024, 2048 and 4096",
        flag="--size",
        many=True,
    )
    triangles: int = option(
        1_000_000,
        "Approximate number of triangles of a generated high-poly mesh.",
        metavar="N",
        low=1000,
        high=MAX_TRIANGLES,
    )
    blender: str | None = option(
        None,
        "Python in which bpy is installed, of the version that bpy needs.",
        metavar="PYTHON",
        default=f"${BLENDER_VARIABLE}",
    )
    repeats: int = option(3, REPEATS_OPTION)
    seconds: float = option(60.0, SECONDS_OPTION)
    timeout: float = option(
        900.0,
        "Seconds after which a run is ended and its setting left out.",
        metavar="S",
        above=0,
        unit="seconds",
    )
    quick: bool = option(False, "Run few settings on small meshes, to see that everything works.")

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in "tasks", "programs", "sizes":
            if not getattr(self, name):
                raise OptionError(f"{name}: none is named; name at least one, or leave it out")
        for size in self.sizes:
            if not 1 <= size <= MAX_SIZE:
                raise OptionError(f"sizes: {size} is out of range; give 1 to {MAX_SIZE}")

    @property
    def ordered_tasks(self) -> tuple[str, ...]:
        """Tasks, each once, in the order of `TASK_NAMES`."""
        return in_order(self.tasks, TASK_NAMES)

    @property
    def ordered_cases(self) -> tuple[str, ...]:
        """Cases, each once, in the order of `CASE_NAMES`."""
        return in_order(self.cases, CASE_NAMES)

    @property
    def ordered_programs(self) -> tuple[str, ...]:
        """Programs, each once, in the order of `PROGRAM_NAMES`."""
        return in_order(self.programs, PROGRAM_NAMES)

    @property
    def map_sizes(self) -> tuple[int, ...]:
        """Sizes of baked maps, smallest first."""
        return (32, 64) if self.quick else tuple(sorted(set(self.sizes)))

    @property
    def one_size(self) -> int:
        """The size at which samples and rays are varied: 1024, or the greatest below."""
        sizes = self.map_sizes
        return max((size for size in sizes if size <= 1024), default=sizes[0])

    @property
    def longest(self) -> float:
        """Seconds after which a run is ended."""
        return min(self.timeout, _QUICK_TIMEOUT) if self.quick else self.timeout

    @property
    def amounts(self) -> Amounts:
        """What is tried beside sizes, and how much of it."""
        return QUICK if self.quick else Amounts()

    @property
    def made_triangles(self) -> int:
        """Triangles of a generated high-poly mesh."""
        return _QUICK_TRIANGLES if self.quick else self.triangles

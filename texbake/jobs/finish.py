"""From the raw mesh of a generator to a finished model, in one call and without a file.

arrays ─ repair ─ simplify or wrap ─ unwrap ─► bake ◄─ a function of points ─► GLB

The steps are those of `run`. Colors and other channels come from a function that is called with
points of the raw mesh, batch by batch, so that sparse voxels, Gaussians, neural fields or
photographs fill the texels.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import asdict, fields, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.baking.result import BakedMap
from texbake.errors import OptionError, counted, quoted, require_least, similar
from texbake.files import PathLike, check_writable
from texbake.jobs.material_transfer import encoded_channels, shared_materials
from texbake.jobs.options import RunOptions
from texbake.jobs.outputs import check_mesh
from texbake.jobs.run import Asset, make_asset
from texbake.mapping.corner_uvs import surface_areas
from texbake.mesh.compose import face_fields
from texbake.mesh.files.gltf_write import write_glb
from texbake.mesh.interchange import plain_array
from texbake.mesh.materials import CHANNELS, ChannelSource, Materials, MeshMaterial
from texbake.mesh.mesh import AnyArray, Float32Array, FloatArray, Mesh
from texbake.mesh.normals import smooth_normals
from texbake.mesh.repair import repair
from texbake.mesh.topology import face_components
from texbake.progress import Progress, StageRecord, Stages
from texbake.records import dataclass
from texbake.texture.encoding import decode_srgb

Sample = Callable[[FloatArray, FloatArray], Any]

_N_FACES = 10_000  # of the result, by default
_BATCH = 1 << 18  # most points of a call
_PROBES = 16  # points with which the function is tried before the work begins
# Names under which functions may return channels, besides those of `CHANNELS`.
_SYNONYMS = {"color": "base-color", "opacity": "alpha"}
# Values farther than this from [0, 1] must have another unit; closer values are clipped.
# Below a step of 8 bits that is rounding.
_FARTHEST, _ROUNDING = 1.0, 1.0 / 255.0
_LEVELS = 65535
_MOST_LEFT_OUT = 0.01  # of the area, where the user does not ask for more


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Finished(Asset):
    """What `finish` made: `low` with texture coordinates, maps, and how they were made."""

    materials: Materials  # of the low-poly mesh, with the maps as encoded images
    bits: tuple[str, ...]  # sentences on parts that were left out and on values that were clipped
    stages: list[StageRecord]  # their times

    def __repr__(self) -> str:
        counts = f"{self.high.n_faces:,} to {self.low.n_faces:,} faces"
        return f"<Finished {self.low.name}: {counts}, {', '.join(self.maps)}>"

    def _repr_html_(self) -> str:
        return self.baked._repr_html_()

    @property
    def mesh(self) -> Mesh:
        """The low-poly mesh, with texture coordinates."""
        return self.low

    @property
    def maps(self) -> dict[str, BakedMap]:
        """The baked maps by their names: `normal`, `displacement`, and channels."""
        return self.baked.maps

    @property
    def warnings(self) -> list[str]:
        """What the user should look at, one sentence each."""
        return [*self.bits, *self.notes, *self.baked.report.warnings]

    @property
    def report(self) -> dict[str, Any]:
        """Every figure as plain values, for `json.dump`."""
        return {
            "faces": [self.high.n_faces, self.low.n_faces],
            "warnings": self.warnings,
            **self.to_json(),
            "stages": [asdict(stage) for stage in self.stages],
        }

    def write(self, path: PathLike) -> Path:
        """Write one GLB file with the mesh, its normal map and its channels."""
        _check_output(path)
        write_glb(self.low, path, materials=self.materials)
        return Path(path)


def finish(
    vertices: npt.ArrayLike,
    faces: npt.ArrayLike,
    *,
    sample: Sample | None = None,
    linear: bool = False,
    least_part: float | None = None,
    output: PathLike | None = None,
    options: RunOptions | None = None,
    name: str = "mesh",
    progress: Progress = None,
    **changes: Any,
) -> Finished:
    """Make a finished model from a generated mesh: few faces, an atlas, and maps.

    texbake repairs, simplifies, unwraps and bakes the mesh, as `run` does. If simplification would
    tear the mesh, or much of it lies inside, texbake simplifies a closed surface around it instead;
    an open mesh stays open.

    Parameters
    ----------
    vertices : (V, 3) floats
        NumPy arrays, or tensors on the CPU; of any float type.
    faces : (F, 3) integers
        Indices into `vertices`, counter-clockwise seen from outside.
    sample : function, optional
        ``sample(points, normals)`` returns values at points of the raw mesh, in the space of
        `vertices`; both arguments are (N, 3) float64, and normals point outwards. It returns colors
        (N, 3), or (N, 4) with opacity, or a dictionary of channels by name: `base_color`, `alpha`
        or `opacity`, `metallic`, `roughness`, `occlusion`, `emissive` and others of glTF. Values
        lie in [0, 1], or are uint8; others, up to 1 away, are clipped, and `warnings` counts them.
        The function is called from the thread of the caller, first with a few points and then with
        up to 262,144 of them, in an order that never changes.
    linear : bool
        Whether the colors of `sample` are linear. By default they are sRGB, as in images.
    least_part : float, optional
        Parts with a smaller share of the surface area are left out, unless they are half as large
        as the largest. By default, parts smaller than a triangle of the result are left out, if
        together they have at most a hundredth of the area; 0 keeps all.
    output : path, optional
        The GLB file to write; `Finished.write` writes it later.
    options, **changes
        `RunOptions`, and fields to change in them, as in ``finish(..., n_faces=5000, size=1024)``.
        The defaults are 10,000 faces and maps of 2048 x 2048 texels. Nothing is compared.
    progress
        True shows a bar. A function is called with the name of each stage and the share of it that
        is done; if it returns False, `finish` raises a `CancelledError`.

    Returns
    -------
    Finished
        The same for any number of threads: `mesh`, `maps`, `report`, `warnings`, `write(path)`.

    Raises
    ------
    MeshError
        The arrays do not describe a mesh.
    OptionError
        `sample` returned something other than finite values for each point. Exceptions of `sample`
        and `progress` pass through unchanged.
    UnwrapError
        No face has an area.

    Examples
    --------
    >>> from texbake.mesh.shapes import icosphere
    >>> ball = icosphere(4)
    >>> done = finish(
    ...     ball.positions, ball.faces, n_faces=500, size=64,
    ...     sample=lambda points, normals: (normals + 1.0) / 2.0,
    ... )
    >>> done
    <Finished mesh: 5,120 to 500 faces, normal, displacement, base-color>
    """
    if output is not None:
        _check_output(output)
    _check_names(changes)
    chosen = replace(options or RunOptions(n_faces=_N_FACES), **changes)
    if chosen.levels:
        raise OptionError("levels: a finished model is one mesh; use run for levels of detail")
    if changes.get("compare", "off") != "off":
        raise OptionError("compare: finish compares nothing; use run")
    if sample is not None and not callable(sample):
        raise OptionError(f"sample: {quoted(sample)} is not a function of points and normals")
    if least_part is not None:
        require_least("least_part", least_part, 0)
    raw = Mesh(
        positions=plain_array(vertices, "vertices"), faces=plain_array(faces, "faces"), name=name
    )
    stages = Stages()
    with stages.part("repair"), Stages(progress).stage("repair"):
        high, bits = _without_bits(repair(raw)[0], least_part, chosen.n_faces)
    material, sampler = MeshMaterial(name=name), None
    if sample is not None:
        sampler = _Sampler(sample, linear)
        found = sampler.probe(high)
        channels = {key: ChannelSource(CHANNELS[key].default, sampler=sampler) for key in found}
        mode = "blend" if "alpha" in found else "opaque"
        material = replace(material, channels=channels, alpha_mode=mode)
    else:
        color = tuple(decode_srgb(np.array(chosen.base_color)).tolist())
        material = replace(material, channels={"base-color": ChannelSource(color)})
    materials = Materials(face_materials=np.zeros(high.n_faces, np.int32), materials=(material,))
    asset, _ = make_asset(
        high, chosen, low_name=name, materials=materials, stages=stages, progress=progress,
        must_reach=False,
    )  # fmt: skip
    with stages.part("encode images"), Stages(progress).stage("encode images"):
        written = _encoded(asset, materials, chosen)
    notes = bits if sampler is None else (*bits, *sampler.notes)
    done = Finished(**vars(asset), materials=written, bits=notes, stages=stages.records)
    if output is not None:
        done.write(output)
    return done


def _without_bits(
    mesh: Mesh, least: float | None, n_faces: int | None
) -> tuple[Mesh, tuple[str, ...]]:
    """Leave out the small parts of a mesh; also return a note on them."""
    parts, _ = face_components(mesh.faces, mesh.n_vertices)
    areas = surface_areas(mesh.positions[mesh.faces] / mesh.diagonal)
    shares = np.bincount(parts, areas) / areas.sum()
    small = shares < min(
        1.0 / (n_faces or mesh.n_faces) if least is None else least, shares.max() / 2.0
    )
    left_out = float(shares[small].sum())
    if not small.any() or (least is None and left_out > _MOST_LEFT_OUT):
        return mesh, ()
    n_small = counted(int(small.sum()), "part")
    note = f"left out {n_small} with {100.0 * left_out:.2g} % of the area; least_part 0 keeps them"
    return mesh.replace(**face_fields(mesh, ~small[parts])), (f"{mesh.name}: {note}",)


def _check_names(changes: Mapping[str, Any]) -> None:
    """Check that changes name options of a run, and suggest a name for a slip."""
    known = [item.name for item in fields(RunOptions)]
    for name in changes:
        if name not in known:
            remedy = similar(name, known) or "see RunOptions for their names"
            raise OptionError(f"{name}: there is no such option; {remedy}")


def _check_output(path: PathLike) -> None:
    if Path(path).suffix.lower() != ".glb":
        raise OptionError(f"output: {path} is not a .glb file, which holds the mesh and its maps")
    check_mesh(path)
    check_writable(path)


def _encoded(asset: Asset, materials: Materials, options: RunOptions) -> Materials:
    """Return materials of the low-poly mesh, with the maps as images."""
    high, low, threads = asset.high, asset.low, options.threads
    channels = encoded_channels(asset.baked.maps, materials, low.name, threads=threads)
    (material,) = materials.materials
    if material.alpha_mode == "blend" and channels["alpha"] == ChannelSource((1.0,)):
        material = replace(material, alpha_mode="opaque")
    return shared_materials(
        low, high, replace(materials, materials=(material,)), channels, low.name, threads=threads
    )


class _Sampler:
    """Calls the function of a user, and checks what it returns."""

    def __init__(self, function: Sample, linear: bool) -> None:
        self._function, self._linear = function, linear
        self._widths: dict[str, int] = {}  # channels that the function returned at first
        self._n_clipped: Counter[str] = Counter()  # values of channels that lay outside [0, 1]

    @property
    def notes(self) -> tuple[str, ...]:
        """A sentence for each channel of which values were clipped."""
        return tuple(
            f"sample: {counted(n, 'value')} of {name} were out of range and clipped"
            for name, n in self._n_clipped.items()
        )

    def probe(self, mesh: Mesh) -> tuple[str, ...]:
        """Call the function with a few vertices of a mesh; return the channels that it has."""
        some = mesh.faces[np.linspace(0, mesh.n_faces - 1, _PROBES).astype(np.intp), 0]
        found = self._call(mesh.positions[some], smooth_normals(mesh)[some])
        self._widths = {name: values.shape[1] for name, values in found.items()}
        self._n_clipped.clear()
        return tuple(self._widths)

    def at(self, points: FloatArray, normals: FloatArray) -> Mapping[str, Float32Array]:
        """Return linear values of each channel."""
        values = {name: np.empty((len(points), n), np.float32) for name, n in self._widths.items()}
        for start in range(0, len(points), _BATCH):
            rows = slice(start, start + _BATCH)
            found = self._call(points[rows], normals[rows])
            if found.keys() != values.keys():
                raise OptionError(
                    f"sample: it returned {', '.join(found)} after {', '.join(values)}; return "
                    "the same channels each time"
                )
            for name, of_rows in found.items():
                values[name][rows] = of_rows
        return values

    def _call(self, points: FloatArray, normals: FloatArray) -> dict[str, Float32Array]:
        n = len(points)
        answer = self._function(points, normals)
        if not isinstance(answer, Mapping):
            values = _checked(answer, "sample", n, (1, 3, 4))
            answer = {"base-color": values[:, :3]}
            if values.shape[1] == 4:
                answer["alpha"] = values[:, 3:]
        if not answer:
            raise OptionError("sample: it returned no channel; return colors, or a dictionary")
        found = {}
        for key, value in answer.items():
            name = str(key).replace("_", "-")
            name = _SYNONYMS.get(name, name)
            if name not in CHANNELS or name == "normal":
                known = ", ".join(name for name in CHANNELS if name != "normal")
                raise OptionError(f"sample: {quoted(key)} is not a channel; return some of {known}")
            if name in found:
                raise OptionError(f"sample: it returned {name} under two names; return one")
            width = len(CHANNELS[name].default)
            values = _checked(value, f"sample: {key}", n, (1, 3) if width == 3 else (1,))
            found[name] = self._linear_values(name, np.broadcast_to(values, (n, width)))
        return found

    def _linear_values(self, name: str, values: AnyArray) -> Float32Array:
        channel = CHANNELS[name]
        top = 1.0 if channel.is_bounded or not self._linear else np.inf
        least, most = float(values.min()), float(values.max())
        if least < -_FARTHEST or most > top + _FARTHEST:
            wanted = "lie in [0, 1], or be uint8" if top == 1.0 else "be 0 or more"
            raise OptionError(
                f"sample: {name} has values from {least:.4g} to {most:.4g}; they must {wanted}"
            )
        if least < -_ROUNDING or most > top + _ROUNDING:
            is_beyond = (values < -_ROUNDING) | (values > top + _ROUNDING)
            self._n_clipped[name] += int(np.count_nonzero(is_beyond))
        values = np.clip(values, 0.0, top)
        if channel.is_color and not self._linear:
            values = _linear_light()[np.rint(values * _LEVELS).astype(np.uint16)]
        return np.ascontiguousarray(values, np.float32)


@cache
def _linear_light() -> Float32Array:
    """Linear values of sRGB levels: as exact as 16-bit images, and ten times as fast."""
    return decode_srgb(np.arange(_LEVELS + 1) / _LEVELS).astype(np.float32)


def _checked(value: Any, what: str, n: int, widths: tuple[int, ...]) -> AnyArray:
    """Return finite values (n, C) of one of some widths; one number per point may be (n,)."""
    values = plain_array(value, what)
    if values.shape == (n,):
        values = values[:, np.newaxis]
    if values.ndim != 2 or len(values) != n or values.shape[1] not in widths:
        wanted = " or ".join(f"({n}, {width})" for width in widths)
        raise OptionError(
            f"{what}: it returned the shape {values.shape} for {n} points, not {wanted}"
        )
    if values.dtype == np.uint8:
        return values / 255.0
    if not np.isfinite(values).all():
        n_bad = int(np.count_nonzero(~np.isfinite(values).all(axis=1)))
        raise OptionError(f"{what}: it returned NaN or infinity at {n_bad} of {n} points")
    return values.astype(np.float64, copy=False)

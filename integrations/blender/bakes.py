# SPDX-License-Identifier: GPL-3.0-or-later
"""The operators for a pair of meshes: bake, and check, which selects the faces that it finds."""

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import bpy
import numpy as np
from bpy.props import IntProperty, StringProperty

from .gather import AnyArray, mean_scale, object_arrays
from .operators import Working, found_again, leave_edit_mode
from .process import Work, WorkError
from .results import load_image, save_file, show_maps, write_flags
from .settings import MAPS, BakeSettings, CheckSettings


def active_mesh(context: bpy.types.Context) -> bpy.types.Object:
    """Return the active object, which must be a mesh whose scale is not 0."""
    low = context.view_layer.objects.active
    if low is None or low.type != "MESH":
        raise WorkError("the active object is not a mesh; select the low-poly mesh last")
    if abs(low.matrix_world.determinant()) == 0.0:
        raise WorkError(f"{low.name}: its scale is 0")
    return low


class Bake(Working, BakeSettings, bpy.types.Operator):
    """Bake the selected high-poly objects to the active low-poly mesh."""

    bl_idname = "texbake.bake"
    bl_label = "Bake Selected to Active"
    group = "bake"

    def begin(self, context: bpy.types.Context) -> Work:
        """Send all meshes in the space of the low-poly mesh."""
        chosen, low = self.chosen(context), active_mesh(context)
        self._cage = self._cage_of(chosen)
        others = [o for o in context.view_layer.objects.selected if o not in (low, self._cage)]
        highs = self.meshes(context, others)
        if not highs:
            raise WorkError(
                "no high-poly mesh is selected; select the high-poly objects first, and the "
                "low-poly mesh last"
            )
        if not chosen.maps:
            raise WorkError("no map is chosen")
        if chosen.save == "FILES" and not bpy.data.filepath:
            raise WorkError("save the .blend file first: images are saved beside it")
        if chosen.wire and not low.data.is_editable:
            raise WorkError(
                f"{low.name}: it is linked from another file; make it local, or turn off Link to "
                "Material"
            )
        self.leave_mode(context)
        depsgraph = context.evaluated_depsgraph_get()
        arrays = object_arrays(low, depsgraph)
        if "uv0" not in arrays:
            raise WorkError(f"{low.name}: it has no UV map; unwrap it first")
        if (chosen.front or chosen.back) and not arrays["is_even"]:
            self.report(
                {"WARNING"},
                f"{low.name}: non-uniform scale makes distances approximate; apply the scale",
            )
        colors = "vertex-color" in chosen.maps
        cages = [] if self._cage is None else [object_arrays(self._cage, depsgraph)]
        self._low, self._chosen = low.name, chosen
        return Work(
            "bake", self._options(chosen, mean_scale(arrays["matrix"])), low=[arrays], cage=cages,
            high=[
                object_arrays(item, depsgraph, layers=colors, colors=colors) for item in highs
            ],
        )  # fmt: skip

    @staticmethod
    def _cage_of(chosen: SimpleNamespace) -> bpy.types.Object | None:
        if not chosen.cage:
            return None
        cage = bpy.data.objects.get(chosen.cage)
        if cage is None or cage.type != "MESH":
            raise WorkError(f"{chosen.cage}: no mesh object of this name exists for the cage")
        return cage

    @staticmethod
    def _options(chosen: SimpleNamespace, scale: float) -> dict[str, Any]:
        options = {
            "maps": [name for name, *_ in MAPS if name in chosen.maps],
            "size": chosen.size,
            "samples": int(chosen.samples) if chosen.samples.isdigit() else chosen.samples,
            "padding": chosen.padding,
            "target": chosen.target,
            "secondary_rays": 2 ** round(math.log2(chosen.rays)),
        }
        for name in "front", "back":
            if distance := getattr(chosen, name):
                options[name] = distance / scale
        return options

    def end(self, context: bpy.types.Context, work: Work) -> str:
        """Load the images, and show them."""
        low, maps = found_again(self._low), work.done["maps"]
        files = [work.folder / baked["file"] for baked in maps]
        is_saved = self._chosen.save == "FILES"
        if is_saved:
            folder = Path(bpy.path.abspath("//textures"))
            try:
                files = [
                    save_file(file, baked["title"], folder)
                    for file, baked in zip(files, maps, strict=True)
                ]
            except OSError as error:
                raise WorkError(f"the images could not be saved: {error}") from error
        images = [
            load_image(file, baked["title"], baked["coding"], packed=not is_saved)
            for file, baked in zip(files, maps, strict=True)
        ]
        if self._chosen.wire:
            work.warnings += show_maps(low, maps, images, work.done["uv"])
        missed = work.done["miss_percent"]
        return f"{', '.join(image.name for image in images)}: {missed:.2f} % of texels missed"


class TexbakeFinding(bpy.types.PropertyGroup):
    """A finding of the last check, as the panel lists it."""

    title: StringProperty()
    severity: StringProperty()
    counted: StringProperty()
    text: StringProperty()


# Polygons by the names of objects, and how many polygons these have.
Faces = dict[str, tuple[AnyArray, int]]
_FACES: list[Faces] = []  # of each finding


class Check(Working, CheckSettings, bpy.types.Operator):
    """Find problems of a bake from the selected objects to the active mesh."""

    bl_idname = "texbake.check"
    bl_label = "Check"
    group = "check"

    def begin(self, context: bpy.types.Context) -> Work:
        """Send the active mesh, and the others as its high-poly mesh."""
        low = active_mesh(context)
        others = [item for item in context.view_layer.objects.selected if item != low]
        highs = self.meshes(context, others)
        self.leave_mode(context)
        depsgraph = context.evaluated_depsgraph_get()
        chosen = self.chosen(context)
        every = [object_arrays(low, depsgraph)]
        every += [object_arrays(item, depsgraph, layers=False) for item in highs]
        self._names = [low.name, *(item.name for item in highs)]
        self._counts = [int(arrays["count"]) for arrays in every]
        options = {"size": chosen.size, "padding": chosen.padding}
        return Work("check", options, mesh=every[:1], high=every[1:])

    def end(self, context: bpy.types.Context, work: Work) -> str:
        """List the findings, and select the faces of the worst one."""
        listed, arrays = context.window_manager.texbake_findings, work.result("out")
        listed.clear()
        _FACES.clear()
        for number, found in enumerate(work.done["findings"]):
            entry = listed.add()
            entry.name = found["name"]
            for field in "title", "severity", "counted", "text":
                setattr(entry, field, found[field])
            _FACES.append(self._by_object(arrays[f"faces{number}"], found["in_high"]))
        worst = next((number for number, faces in enumerate(_FACES) if faces), None)
        if worst is not None:
            try:
                select_faces(context, _FACES[worst])
            except WorkError as error:
                self.report({"WARNING"}, str(error))
        named = [f"{entry.severity}: {entry.title} ({entry.counted})" for entry in listed]
        for line in named:
            self.report({"WARNING"}, line)
        return f"Findings: {len(named)}" if named else "No problems found"

    def _by_object(self, polygons: AnyArray, in_high: bool) -> Faces:
        """Return the polygons of each object, from those of all high-poly objects together."""
        names, counts = self._names, self._counts
        names, counts = (names[1:], counts[1:]) if in_high else (names[:1], counts[:1])
        starts = np.cumsum([0, *counts])
        parts = {}
        for name, start, end in zip(names, starts, starts[1:], strict=False):
            inside = polygons[(polygons >= start) & (polygons < end)] - start
            if len(inside):
                parts[name] = (inside, int(end - start))
        return parts


def select_faces(context: bpy.types.Context, parts: Faces) -> None:
    """Select faces of objects: for each name, their numbers, and how many the object has."""
    items = [found_again(name) for name in parts]
    for item, (_, count) in zip(items, parts.values(), strict=True):
        item.update_from_editmode()
        if len(item.data.polygons) != count:
            raise WorkError(
                f"{item.name}: the faces cannot be selected, because its modifiers change them, or "
                "because it was changed after the check"
            )
    leave_edit_mode(context)
    for item in tuple(context.view_layer.objects.selected):
        item.select_set(False)
    for item, (faces, count) in zip(items, parts.values(), strict=True):
        item.select_set(True)
        context.view_layer.objects.active = item
        data = item.data
        write_flags(data, ".select_vert", "POINT", np.zeros(len(data.vertices)))
        write_flags(data, ".select_edge", "EDGE", np.zeros(len(data.edges)))
        write_flags(data, ".select_poly", "FACE", np.isin(np.arange(count), faces))
    context.tool_settings.mesh_select_mode = (False, False, True)
    bpy.ops.object.mode_set(mode="EDIT")


class SelectFinding(bpy.types.Operator):
    """Select the faces that a finding names."""

    bl_idname = "texbake.select_finding"
    bl_label = "Select Faces"
    bl_options = {"UNDO"}  # noqa: RUF012
    number: IntProperty()

    @classmethod
    def description(cls, context: bpy.types.Context, properties: Any) -> str:
        """Return what the finding says."""
        listed = context.window_manager.texbake_findings
        return listed[properties.number].text if properties.number < len(listed) else cls.__doc__

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Select them in edit mode."""
        if not 0 <= self.number < len(_FACES) or not _FACES[self.number]:
            self.report({"ERROR"}, "this finding names no faces; check again")
            return {"CANCELLED"}
        try:
            select_faces(context, _FACES[self.number])
        except WorkError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        return {"FINISHED"}


CLASSES = (TexbakeFinding, Bake, Check, SelectFinding)

# SPDX-License-Identifier: GPL-3.0-or-later
"""What all operators share, and those that make or change meshes."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import bpy

from .gather import marked_edges, mesh_arrays, object_arrays
from .process import RUNNING, Work, WorkError
from .results import MOST_UV_MAPS, has_room, make_object, set_uvs
from .settings import LightenSettings, RemeshSettings, SimplifySettings, UnwrapSettings

_TICK = 0.1  # seconds between two looks at the running process


def leave_edit_mode(context: bpy.types.Context) -> tuple[str, str] | None:
    """Go to object mode; return the name of the active object and the mode that it was in."""
    item = context.view_layer.objects.active
    if item is None or item.mode == "OBJECT":
        return None
    left = item.name, item.mode
    bpy.ops.object.mode_set(mode="OBJECT")
    return left


class Working:
    """An operator whose work another process does, while the interface stays responsive.

    Called by a script, or without a window, it waits until the work is done. A class has `group`,
    the name of its settings, `begin`, which starts the work, and `end`, which takes its result.
    """

    bl_options = {"UNDO"}  # noqa: RUF012
    group = ""

    _work = None
    _timer = None
    _left = None  # the name of the object and the mode that `leave_mode` left

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return whether no other process runs: only one does at a time."""
        if RUNNING:
            cls.poll_message_set("texbake is already running; press Esc to stop it")
        return not RUNNING

    def chosen(self, context: bpy.types.Context) -> SimpleNamespace:
        """Return the settings: those given to the operator, else those of the panel."""
        panel = getattr(context.scene.texbake, self.group)
        names = [p.identifier for p in panel.bl_rna.properties if p.identifier not in BUILT_IN]
        return SimpleNamespace(**{
            name: getattr(self if self.properties.is_property_set(name) else panel, name)
            for name in names
        })  # fmt: skip

    def meshes(self, context: bpy.types.Context, items: Any = None) -> list[bpy.types.Object]:
        """Return those of the selected objects that are meshes, and report all others."""
        items = context.view_layer.objects.selected if items is None else items
        others = [item.name for item in items if item.type != "MESH"]
        if others:
            self.report({"WARNING"}, f"Skipped, because they are not meshes: {', '.join(others)}")
        return [item for item in items if item.type == "MESH"]

    def some_meshes(self, context: bpy.types.Context) -> list[bpy.types.Object]:
        """Return the selected meshes, at least one."""
        if not (found := self.meshes(context)):
            raise WorkError("no mesh is selected; select one")
        return found

    def leave_mode(self, context: bpy.types.Context) -> None:
        """Go to object mode until the operator ends."""
        self._left = leave_edit_mode(context) or self._left

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Run until the work is done."""
        try:
            self._work = self.begin(context)
            self._work.poll(wait=True)
            return self._ended(context)
        except WorkError as error:
            return self._failed(error)
        finally:
            self._close(context)

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Start the work, and watch the process with a timer."""
        if bpy.app.background or context.window is None:
            return self.execute(context)
        try:
            self._work = self.begin(context)
        except WorkError as error:
            return self._failed(error)
        finally:
            if self._work is None:
                self._close(context)
        manager = context.window_manager
        self._timer = manager.event_timer_add(_TICK, window=context.window)
        manager.modal_handler_add(self)
        manager.progress_begin(0, 100)
        self._show(context)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Look at the process; Esc ends it."""
        if event.type == "ESC" and event.value == "PRESS":
            self._close(context)
            self.report({"INFO"}, "texbake was stopped; nothing has changed")
            return {"CANCELLED"}
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        try:
            if not self._work.poll():
                self._show(context)
                return {"PASS_THROUGH"}
            result = self._ended(context)
        except WorkError as error:
            result = self._failed(error)
        except Exception:
            self._close(context)
            raise
        self._close(context)
        return result

    def cancel(self, context: bpy.types.Context) -> None:
        """Stop, because Blender closes or opens another file."""
        self._left = None
        self._close(context)

    def _show(self, context: bpy.types.Context) -> None:
        fraction = self._work.fraction
        share = "" if fraction is None else f" {fraction:.0%}"
        context.workspace.status_text_set(f"texbake: {self._work.stage}{share}   |   Esc: Stop")
        context.window_manager.progress_update(int(100 * (fraction or 0.0)))

    def _ended(self, context: bpy.types.Context) -> set[str]:
        message = self.end(context, self._work)
        for warning in self._work.warnings:
            self.report({"WARNING"}, warning)
        self.report({"INFO"}, message)
        return {"FINISHED"}

    def _failed(self, error: WorkError) -> set[str]:
        self.report({"ERROR"}, str(error))
        return {"CANCELLED"}

    def _close(self, context: bpy.types.Context) -> None:
        if self._work is not None:
            self._work.close()
            self._work = None
        if self._timer is not None:
            context.window_manager.event_timer_remove(self._timer)
            context.window_manager.progress_end()
            context.workspace.status_text_set(None)
            self._timer = None
        if self._left is not None:
            (name, mode), self._left = self._left, None
            item = context.view_layer.objects.active
            # Not if a new object is active, or the user has gone on in another mode.
            if item is not None and (item.name, item.mode) == (name, "OBJECT"):
                bpy.ops.object.mode_set(mode=mode)


# Properties that every group has.
BUILT_IN = {"rna_type", "name"}


def found_again(name: str) -> bpy.types.Object:
    """Return an object by its name, after the work."""
    item = bpy.data.objects.get(name)
    if item is None:
        raise WorkError(f"{name}: it was removed or renamed while texbake was running")
    return item


class Unwrap(Working, UnwrapSettings, bpy.types.Operator):
    """Unwrap the selected meshes into one texture."""

    bl_idname = "texbake.unwrap"
    bl_label = "Unwrap"
    group = "unwrap"

    def begin(self, context: bpy.types.Context) -> Work:
        """Send the meshes without their modifiers, which keep the coordinates."""
        items = self.some_meshes(context)
        self.leave_mode(context)
        items = list({item.data: item for item in items}.values())
        chosen = self.chosen(context)
        self._names, self._maps, every = [], [], []
        for item in items:
            if not item.data.is_editable:
                raise WorkError(f"{item.name}: it is linked from another file; make it local first")
            active = item.data.uv_layers.active
            if chosen.seams in ("UV", "PACK") and active is None:
                raise WorkError(f"{item.name}: it has no UV map, so there are no seams to keep")
            every.append(mesh_arrays(item.data, item.name) | marked_edges(item.data))
            self._names.append(item.name)
            self._maps.append(chosen.uv_map or (active.name if active else "UVMap"))
        self._check_room(items)
        is_cut = chosen.seams != "PACK"
        kinds = ["seams"] * (chosen.seams == "MARKED") + ["sharp"] * (chosen.sharp and is_cut)
        options = {
            "size": chosen.size, "padding": chosen.padding, "kinds": kinds, "keep": not is_cut,
            "keep_seams": chosen.seams == "UV",
        } | ({"quality": chosen.quality} if is_cut else {})  # fmt: skip
        return Work("unwrap", options, mesh=every)

    def end(self, context: bpy.types.Context, work: Work) -> str:
        """Write the coordinates."""
        self.leave_mode(context)
        items = [found_again(name) for name in self._names]
        results = [work.result(f"out{number}")["uvs"] for number in range(len(items))]
        for item, uvs in zip(items, results, strict=True):
            if len(item.data.loops) != len(uvs):
                raise WorkError(f"{item.name}: it was changed while texbake was running")
        self._check_room(items)
        for item, name, uvs in zip(items, self._maps, results, strict=True):
            set_uvs(item, name, uvs)
        return f"{work.done['charts']:,} UV islands"

    def _check_room(self, items: list[bpy.types.Object]) -> None:
        for item, name in zip(items, self._maps, strict=True):
            if not has_room(item.data, name):
                raise WorkError(
                    f"{item.name}: it already has {MOST_UV_MAPS} UV maps, the most possible"
                )


class Reducing(Working):
    """Makes new objects beside the selected ones, which stay as they are."""

    suffix = ""

    def start(self, context: bpy.types.Context, options: dict[str, Any]) -> Work:
        """Send the selected meshes with their modifiers."""
        items = self.some_meshes(context)
        self.leave_mode(context)
        depsgraph = context.evaluated_depsgraph_get()
        self._names = [item.name for item in items]
        every = [object_arrays(item, depsgraph, colors=True) for item in items]
        self._maps = [str(arrays["uv_names"][0]) if "uv0" in arrays else "" for arrays in every]
        if not all(arrays["is_even"] for arrays in every):
            self.report(
                {"INFO"}, "Objects with non-uniform scale are reduced as the scene shows them"
            )
        return Work(self.group, options, mesh=every)

    def end(self, context: bpy.types.Context, work: Work) -> str:
        """Make the objects, select them with their sources, and make the last one active."""
        self.leave_mode(context)
        items = [found_again(name) for name in self._names]
        for number, item in enumerate(items):
            arrays = work.result(f"out{number}")
            made = make_object(item, arrays, self.suffix, self._maps[number])
            made.select_set(True)
            context.view_layer.objects.active = made
        before, after = (sum(column) for column in zip(*work.done["faces"], strict=True))
        return f"{before:,} triangles became {after:,}"


class Simplify(Reducing, SimplifySettings, bpy.types.Operator):
    """Make copies of the selected meshes with fewer triangles."""

    bl_idname = "texbake.simplify"
    bl_label = "Simplify"
    group, suffix = "simplify", "low"

    def begin(self, context: bpy.types.Context) -> Work:
        """Start."""
        chosen = self.chosen(context)
        options = {"quality": chosen.quality, "seams": chosen.seams, "ratio": None}
        options["n_faces" if chosen.faces else "ratio"] = chosen.faces or chosen.ratio
        return self.start(context, options)


class Remesh(Reducing, RemeshSettings, bpy.types.Operator):
    """Make new surfaces around the selected meshes, without holes and inner walls."""

    bl_idname = "texbake.remesh"
    bl_label = "Remesh"
    group, suffix = "remesh", "remesh"

    def begin(self, context: bpy.types.Context) -> Work:
        """Start."""
        chosen = self.chosen(context)
        options = {name: getattr(chosen, name) for name in ("resolution", "surface", "sharp_edges")}
        return self.start(context, {
            **options, "close": f"{chosen.close}%", "n_faces": chosen.faces or None,
        })  # fmt: skip


class Lighten(Working, LightenSettings, bpy.types.Operator):
    """Make a smaller copy of the selected textured meshes, with one set of images."""

    bl_idname = "texbake.lighten"
    bl_label = "Lighten"
    group = "lighten"

    def begin(self, context: bpy.types.Context) -> Work:
        """Send the selection as a glTF file, which has its materials and images."""
        items = self.some_meshes(context)
        if "io_scene_gltf2" not in context.preferences.addons:
            raise WorkError("the add-on glTF 2.0 is disabled; enable it in the preferences")
        self.leave_mode(context)
        chosen = self.chosen(context)
        self._name = items[0].name
        options = {"n_faces": chosen.faces or None, "size": chosen.size or None}
        selected = tuple(context.view_layer.objects.selected)
        for item in selected:
            item.select_set(item in items)
        try:
            return Work("lighten", options, prepare=export_selection)
        finally:
            for item in selected:
                item.select_set(True)

    def end(self, context: bpy.types.Context, work: Work) -> str:
        """Import the result, which Blender then selects."""
        self.leave_mode(context)
        images = set(bpy.data.images)
        bpy.ops.import_scene.gltf(filepath=str(work.folder / "out.glb"))
        for item in (*context.view_layer.objects.selected, *(set(bpy.data.images) - images)):
            item.name = f"{self._name}_light"
        before, after = work.done["faces"][0]
        return f"{before:,} triangles became {after:,}"


def export_selection(folder: Path) -> None:
    """Write the selected objects as a glTF file."""
    bpy.ops.export_scene.gltf(
        filepath=str(folder / "in.glb"), export_format="GLB", use_selection=True,
        export_apply=True, export_animations=False, export_skins=False, export_morph=False,
    )  # fmt: skip


CLASSES = (Unwrap, Simplify, Remesh, Lighten)

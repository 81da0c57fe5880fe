# SPDX-License-Identifier: GPL-3.0-or-later
"""The extension for Blender: its menus and panel. See docs/how-to/blender.md."""

import atexit

import bpy

from . import bakes, operators, settings
from .bakes import TexbakeFinding
from .process import close_all


class ObjectMenu(bpy.types.Menu):
    """All operators, in the Object menu of the 3D viewport."""

    bl_idname = "TEXBAKE_MT_object"
    bl_label = "texbake"

    def draw(self, context: bpy.types.Context) -> None:
        """List them."""
        self.layout.operator_context = "INVOKE_DEFAULT"
        for name in settings.GROUPS:
            self.layout.operator(f"texbake.{name}")


def draw_object_menu(self: bpy.types.Menu, context: bpy.types.Context) -> None:
    """Add the menu."""
    self.layout.separator()
    self.layout.menu("TEXBAKE_MT_object")


def draw_uv_menu(self: bpy.types.Menu, context: bpy.types.Context) -> None:
    """Add the operators for texture coordinates."""
    self.layout.separator()
    self.layout.operator_context = "INVOKE_DEFAULT"
    self.layout.operator("texbake.unwrap", text="Unwrap (texbake)")
    self.layout.operator("texbake.check", text="Check (texbake)")


class Panel:
    """A panel of the sidebar with one operator and its settings."""

    bl_space_type, bl_region_type, bl_category = "VIEW_3D", "UI", "texbake"
    group = ""

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the settings, and the button below them."""
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.operator_context = "INVOKE_DEFAULT"
        chosen = getattr(context.scene.texbake, self.group)
        for name in chosen.bl_rna.properties.keys():  # noqa: SIM118
            if name == "maps":
                layout.column(align=True).prop(chosen, name)
            elif name == "cage":
                layout.prop_search(chosen, name, bpy.data, "objects")
            elif name not in operators.BUILT_IN:
                layout.prop(chosen, name)
        layout.operator(f"texbake.{self.group}")


def _panel(number: int, group: str, label: str) -> type:
    """Return the class of a panel."""
    fields = {
        "bl_idname": f"TEXBAKE_PT_{group}", "bl_label": label, "bl_order": number, "group": group,
        "bl_options": set() if group == "bake" else {"DEFAULT_CLOSED"},
    }  # fmt: skip
    return type(fields["bl_idname"], (Panel, bpy.types.Panel), fields)


PANELS = tuple(_panel(number, name, name.title()) for number, name in enumerate(settings.GROUPS))


class FindingsPanel(bpy.types.Panel):
    """What the last check found."""

    bl_space_type, bl_region_type, bl_category = "VIEW_3D", "UI", "texbake"
    bl_idname = "TEXBAKE_PT_findings"
    bl_label = "Findings"
    bl_parent_id = "TEXBAKE_PT_check"

    def draw(self, context: bpy.types.Context) -> None:
        """Draw a button for each finding, which selects its faces."""
        listed = context.window_manager.texbake_findings
        icons = {"error": "CANCEL", "warning": "ERROR", "note": "INFO"}
        for number, entry in enumerate(listed):
            button = self.layout.operator(
                "texbake.select_finding", text=f"{entry.title}: {entry.counted}",
                icon=icons.get(entry.severity, "NONE"),
            )  # fmt: skip
            button.number = number


CLASSES = (
    *settings.CLASSES, *operators.CLASSES, *bakes.CLASSES, ObjectMenu, *PANELS, FindingsPanel,
)  # fmt: skip


def register() -> None:
    """Add everything to Blender."""
    for item in CLASSES:
        bpy.utils.register_class(item)
    bpy.types.Scene.texbake = bpy.props.PointerProperty(type=settings.TexbakeSettings)
    bpy.types.WindowManager.texbake_findings = bpy.props.CollectionProperty(type=TexbakeFinding)
    bpy.types.VIEW3D_MT_object.append(draw_object_menu)
    bpy.types.IMAGE_MT_uvs.append(draw_uv_menu)
    atexit.register(close_all)


def unregister() -> None:
    """Remove everything, and end processes that still run."""
    close_all()
    atexit.unregister(close_all)
    bpy.types.IMAGE_MT_uvs.remove(draw_uv_menu)
    bpy.types.VIEW3D_MT_object.remove(draw_object_menu)
    del bpy.types.WindowManager.texbake_findings
    del bpy.types.Scene.texbake
    for item in reversed(CLASSES):
        bpy.utils.unregister_class(item)

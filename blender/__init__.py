"""Blender extension: Object → Bake Obscurance, by an installed `obscurance` in a process of its own."""

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty, StringProperty

from .job import BakeFailed, Job, find_command
from .results import store_colours, store_image
from .scene import Source, collect

INSTALL = "python -m pip install . in its folder"
_NAVIGATION = {"MIDDLEMOUSE", "WHEELUPMOUSE", "WHEELDOWNMOUSE", "TRACKPADPAN", "TRACKPADZOOM", "NDOF_MOTION"}


class Preferences(bpy.types.AddonPreferences):
    """Where the command is."""

    bl_idname = __package__

    command: StringProperty(
        name="Command", subtype="FILE_PATH", default="obscurance", description="The obscurance command, or its path"
    )

    def draw(self, context):
        """Show the path, and how to install what is not found."""
        self.layout.prop(self, "command")
        if find_command(self.command) is None:
            self.layout.label(text=f"Not found. To install it: {INSTALL}", icon="ERROR")


class BakeObscurance(bpy.types.Operator):
    """Bake ambient occlusion or obscurance of the selected objects, as their modifiers leave them"""

    bl_idname = "object.bake_obscurance"
    bl_label = "Bake Obscurance"
    bl_options = {"UNDO"}  # noqa: RUF012 - not REGISTER: to repeat it by the panel of the last operator ends Blender

    target: EnumProperty(
        name="Into",
        items=[
            ("COLOUR", "Colour Attribute", "One colour a face corner"),
            ("IMAGE", "Image", "By the active UV map, with a texture node in each material"),
        ],
    )
    name: StringProperty(name="Name", default="Obscurance", maxlen=60, description="Of the attribute, image and node")
    size: IntProperty(name="Image Size", default=1024, min=16, max=16384, subtype="PIXEL")
    falloff: EnumProperty(
        name="Falloff",
        items=[
            ("exponential", "Exponential", "Obscurance: near surfaces close more than far ones"),
            ("binary", "Binary", "Ambient occlusion: what is hit closes"),
            ("linear", "Linear", "Fades to nothing at the greatest distance"),
            ("smooth", "Smooth", "Fades to nothing at the greatest distance, by the smooth step"),
        ],
    )
    half_distance: StringProperty(
        name="Half Distance", default="50%", description="Where a hit closes half; of the exponential falloff"
    )
    max_distance: StringProperty(
        name="Max Distance",
        default="inf",
        description='Farther hits close nothing: a length, "25%" of the size, or inf',
    )
    tolerance: FloatProperty(
        name="Tolerance", default=0.005, min=1e-4, max=0.5, precision=4, description="RMS error of the openness"
    )
    others: BoolProperty(name="Others Occlude", default=True, description="All other visible objects and instances")
    ground: BoolProperty(name="Ground", description="An endless plane just below the selected objects occludes")
    one_sided: BoolProperty(name="Pass Back Faces", description="Rays pass through faces that they meet from behind")

    @classmethod
    def poll(cls, context):
        """Whether something that has faces is selected."""
        return context.mode == "OBJECT" and any(thing.type == "MESH" for thing in context.selected_objects)

    def invoke(self, context, event):
        """Ask for the options."""
        return context.window_manager.invoke_props_dialog(self)

    def execute(self, context):
        """Start the bake; without a window, also finish it."""
        command = find_command(context.preferences.addons[__package__].preferences.command)
        if command is None:
            self.report({"ERROR"}, f"obscurance is not found. Install it ({INSTALL}), or set its path in Preferences")
            return {"CANCELLED"}
        try:
            self._sources = collect(context, self.others, needs_uv=self.target == "IMAGE")
            self._job = Job(command, self._sources, self._options())
        except (BakeFailed, OSError) as reason:
            return self._failed(reason)
        if bpy.app.background or context.window is None:
            self._job.wait()
            return self._finish(context)
        manager = context.window_manager
        manager.progress_begin(0, 100)
        self._timer = manager.event_timer_add(0.1, window=context.window)
        manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        """Show how far it is; Esc cancels. Until then the view alone can be changed."""
        if event.type == "ESC":
            self.cancel(context)
            self.report({"INFO"}, "Cancelled")
            return {"CANCELLED"}
        if event.type in _NAVIGATION:
            return {"PASS_THROUGH"}
        if event.type != "TIMER":
            return {"RUNNING_MODAL"}
        context.window_manager.progress_update(round(100 * self._job.share))
        context.workspace.status_text_set(f"Bake Obscurance: {self._job.stage} {self._job.share:.0%}   Esc: cancel")
        if self._job.is_running:
            return {"RUNNING_MODAL"}
        self._end(context)
        return self._finish(context)

    def cancel(self, context):
        """End the bake; called by Blender, too, when it quits or opens another file."""
        self._job.cancel()
        self._end(context)

    def _options(self):
        """The command's options."""
        options = ["--falloff", self.falloff, "--max-distance", self.max_distance, "--tolerance", f"{self.tolerance:g}"]
        if self.falloff == "exponential":
            options += ["--half-distance", self.half_distance]
        if self.ground:
            options += ["--ground", "auto", "--up", "z"]
        if self.one_sided:
            options += ["--back-faces", "ignore"]
        return options + (["--size", str(self.size)] if self.target == "IMAGE" else [])

    def _end(self, context):
        """Take the timer and the progress away."""
        context.window_manager.event_timer_remove(self._timer)
        context.window_manager.progress_end()
        context.workspace.status_text_set(None)

    def _finish(self, context):
        """Store the results."""
        try:
            with self._job as results:
                for source in self._sources.baked:
                    self._store(source, results)
        except BakeFailed as reason:
            return self._failed(reason)
        self.report({"INFO"}, f"Baked {self._job.summary}")
        return {"FINISHED"}

    def _store(self, source: Source, results):
        """Store w of one object."""
        if self.target == "IMAGE":
            store_image(source, results.image(source), self.name)
        else:
            store_colours(source, results.corners(source), self.name)

    def _failed(self, reason):
        self.report({"ERROR"}, str(reason))
        return {"CANCELLED"}


def _menu(menu, context):
    menu.layout.separator()
    menu.layout.operator(BakeObscurance.bl_idname)


def register():
    """Called by Blender."""
    bpy.utils.register_class(Preferences)
    bpy.utils.register_class(BakeObscurance)
    bpy.types.VIEW3D_MT_object.append(_menu)


def unregister():
    """Called by Blender."""
    bpy.types.VIEW3D_MT_object.remove(_menu)
    bpy.utils.unregister_class(BakeObscurance)
    bpy.utils.unregister_class(Preferences)

# The public names, imported when first used; type checkers read them here.
from . import ao as ao
from . import raytrace as raytrace
from . import scenes as scenes
from .ao import Binary as Binary
from .ao import Exponential as Exponential
from .ao import Linear as Linear
from .ao import Smooth as Smooth
from .ao import Tabulated as Tabulated
from .ao import bake_points as bake_points
from .ao import bake_texture as bake_texture
from .raytrace import Camera as Camera
from .scenes import load as load
from .scenes import render as render
from .scenes import unwrap as unwrap
from .scenes import view as view
from .scenes import write as write
from .scenes.commands.in_python import bake as bake

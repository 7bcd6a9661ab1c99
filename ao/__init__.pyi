# The public names, imported when first used; type checkers read them here, and so does the package.
from .adaptive.tolerance import ToleranceWarning as ToleranceWarning
from .falloff import Binary as Binary
from .falloff import Exponential as Exponential
from .falloff import Falloff as Falloff
from .gather.receivers import Flag as Flag
from .surface_method import bake_surface as bake_surface
from .vertex_method import Bake as Bake
from .vertex_method import bake as bake

# The public names, imported when first used; type checkers read them here, and so does the package.
from .bake import Bake as Bake
from .bake import bake as bake
from .falloff import Binary as Binary
from .falloff import Exponential as Exponential
from .falloff import Falloff as Falloff
from .receivers import Flag as Flag
from .surface import bake_surface as bake_surface
from .tolerance import ToleranceWarning as ToleranceWarning

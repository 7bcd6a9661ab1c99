# The public names, imported when first used; type checkers read them here, and so does the package.
from .adaptive.tolerance import ToleranceWarning as ToleranceWarning
from .baking import bake as bake
from .falloff import Binary as Binary
from .falloff import Exponential as Exponential
from .falloff import Falloff as Falloff
from .falloff import Linear as Linear
from .falloff import Smooth as Smooth
from .falloff import Tabulated as Tabulated
from .gather.receivers import Flag as Flag
from .result import Bake as Bake
from .texture.baking import bake_texture as bake_texture
from .texture.result import BakedTexture as BakedTexture

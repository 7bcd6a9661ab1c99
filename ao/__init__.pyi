# The public names, imported when first used; type checkers read them here, and so does the package.
from .baking import bake as bake
from .estimate.tolerance import ToleranceWarning as ToleranceWarning
from .falloff import Binary as Binary
from .falloff import Exponential as Exponential
from .falloff import Falloff as Falloff
from .falloff import Linear as Linear
from .falloff import Smooth as Smooth
from .falloff import Tabulated as Tabulated
from .points.occluders import ground as ground
from .points.receivers import Flag as Flag
from .prepared import PreparedMesh as PreparedMesh
from .prepared import prepare as prepare
from .profile import Profile as Profile
from .result import Bake as Bake
from .texture.bake_texture import bake_texture as bake_texture
from .texture.result import BakedTexture as BakedTexture

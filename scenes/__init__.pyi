# The public names, imported when first used; type checkers read them here, and so does the package.
from .description.description import SceneDescription as SceneDescription
from .description.read import read_scene as read_scene
from .geometry.builtin_shapes import SOLIDS as SOLIDS
from .geometry.builtin_shapes import Box as Box
from .geometry.builtin_shapes import Cylinder as Cylinder
from .geometry.builtin_shapes import Plane as Plane
from .geometry.builtin_shapes import Solid as Solid
from .geometry.builtin_shapes import Sphere as Sphere
from .geometry.builtin_shapes import Sponge as Sponge
from .geometry.builtin_shapes import Temple as Temple
from .library.catalogue import BUILTIN as BUILTIN
from .library.catalogue import builtin_toml as builtin_toml
from .library.catalogue import write_builtin as write_builtin
from .readers.load import MeshFile as MeshFile
from .readers.load import load as load
from .readers.stored_w import read_w as read_w
from .writers.write import write as write

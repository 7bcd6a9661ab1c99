"""Ray casting on Embree and local illumination; knows nothing of baking, scene files or the command line."""

from .errors import EmbreeError, InputError, MeshError, ObscuranceError, OptionError, OutputError
from .mesh import Mesh

__all__ = ["EmbreeError", "InputError", "Mesh", "MeshError", "ObscuranceError", "OptionError", "OutputError"]

"""Ray casting on Embree and local illumination; knows nothing of baking, scene files or the command line.

The public names stand in `__init__.pyi`. They are imported when they are first used: the package alone costs
nothing.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

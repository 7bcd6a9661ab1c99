"""Ambient occlusion and obscurance: the names most used, and the packages `ao`, `raytrace` and `scenes` with all.

    import obscurance
    baked = obscurance.bake("duck.glb", max_distance="20%")
    obscurance.write("duck_ao.glb", baked, "duck.glb")

The public names stand in `__init__.pyi` and are imported when they are first used. In the source tree the packages and
`cli.py`, the command, stand beside this folder; installed, all lies within it.
"""

import os.path

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
if not os.path.isfile(os.path.join(os.path.dirname(__file__), "cli.py")):
    __path__.append(os.path.dirname(os.path.dirname(__file__)))

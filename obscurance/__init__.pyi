# The public names, imported when first used; type checkers read them here.
from ao import bake as bake
from ao import bake_texture as bake_texture
from scenes import load as load
from scenes import render as render
from scenes import view as view
from scenes import write as write

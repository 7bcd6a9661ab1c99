"""One row a point that is to be lit: what shading needs of it, and what lighting makes of it.

Float64 columns, so that a kernel's scratch is one array. Positions are in the world's own units.

========= ======= =====================================================================
column    columns content
========= ======= =====================================================================
POINT     3       where light is gathered (a face's centroid under constant shading)
ORIGIN    3       where its shadow rays begin, safely above the surface
NORMAL    3       unit shading normal on the viewer's side; zero reflects nothing
VIEW      3       unit direction to the viewer
GRAIN     3       tangent along u of the texture coordinates; zero where there are none
TINT      3       albedo texture, 1 without
GEOMETRIC 3       unit normal of the face, on the viewer's side
FRONT     1       whether the viewer sees a side that reflects
W         1       obscurance w(p)
OBJECT    1       row of the object
DEPTH     1       distance to the viewer
PIXEL     1       pixel of the tile
AMBIENT … 3 each  ambient, diffuse, specular and emitted RGB
SENT, LIT 1 each  luminous sum over lights before δ, and after
========= ======= =====================================================================
"""

from __future__ import annotations

POINT, ORIGIN, NORMAL, VIEW, GRAIN, TINT, GEOMETRIC = range(0, 21, 3)
FRONT, W, OBJECT, DEPTH, PIXEL = range(21, 26)
AMBIENT, DIFFUSE, SPECULAR, EMISSION = range(26, 38, 3)
SENT, LIT = 38, 39
WIDTH = 40

"""Writes snap_ring.msh beside itself: a ring of 40 mm mean radius and 2 mm thickness with a slit of 1 mm.

    python3 meshes/snap_ring.py
"""

from math import cos, pi, sin
from pathlib import Path

import gmsh

RADII = (0.039, 0.041)
SLIT = 0.0125
ARC, LAYERS = 96, 2

nodes, triangles = [], []


def angle(i):
    """The angle of a node from the middle of the slit: a quarter of the nodes each above and below it, and the rest beyond."""
    if 2 * i > ARC:
        return 2 * pi - angle(ARC - i)
    quarter = ARC // 4
    return SLIT + (pi / 2 - SLIT) * i / quarter if i < quarter else pi / 2 * i / quarter


for j in range(LAYERS + 1):
    radius = RADII[0] + (RADII[1] - RADII[0]) * j / LAYERS
    for i in range(ARC + 1):
        # Two nodes lie on the diameter across the slit.
        nodes.append((radius * cos(angle(i)), 0.0 if 2 * i == ARC else radius * sin(angle(i))))


def at(i, j):
    return 1 + i + j * (ARC + 1)


for i in range(ARC):
    for j in range(LAYERS):
        # Mirror images above and below the diameter.
        a, b, c, d = at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)
        triangles += [(a, b, c), (a, c, d)] if 2 * i < ARC else [(a, b, d), (b, c, d)]
outer = [(at(i, LAYERS), at(i + 1, LAYERS)) for i in range(ARC)]
TOP = (ARC // 4 - 1, ARC // 4)
edges = {
    "upper face": [(at(0, j), at(0, j + 1)) for j in range(LAYERS)],
    "lower face": [(at(ARC, j), at(ARC, j + 1)) for j in range(LAYERS)],
    "inner": [(at(i, 0), at(i + 1, 0)) for i in range(ARC)],
    "outer": [edge for i, edge in enumerate(outer) if i not in TOP and ARC - 1 - i not in TOP],
    "top": [outer[i] for i in TOP],
    "foot": [outer[ARC - 1 - i] for i in TOP],
}
box = (-RADII[1], -RADII[1], RADII[1], RADII[1])
places = [f"{x!r} {y!r}" for x, y in nodes]
gmsh.write(Path(__file__).with_name("snap_ring.msh"), places, box, edges, triangles)

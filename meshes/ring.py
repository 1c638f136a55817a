"""Writes ring_coarse.msh, ring_medium.msh and ring_fine.msh beside itself: quarters of a ring with crossed diagonals.

    python3 meshes/ring.py
"""

from math import cos, pi, sin
from pathlib import Path

import gmsh

INNER, OUTER = 1.0, 2.0


def ring(radial):
    """Nodes, triangles and named edges of a quarter with this number of cells along the radius, twice as many along the arc."""
    arc, nodes, numbers, triangles = 2 * radial, [], {}, []

    def corner(i, j):
        radius = INNER * (OUTER / INNER) ** (i / radial)
        angle = pi / 2 * j / arc
        return (0.0 if j == arc else radius * cos(angle), 0.0 if j == 0 else radius * sin(angle))

    def add(key, point):
        nodes.append(point)
        numbers[key] = len(nodes)

    for i in range(radial + 1):
        for j in range(arc + 1):
            add((i, j), corner(i, j))
    for i in range(radial):
        for j in range(arc):
            corners = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)]
            points = [corner(*one) for one in corners]
            add((i, j, "centre"), tuple(sum(axis) / 4 for axis in zip(*points)))
            for one, next_one in zip(corners, corners[1:] + corners[:1]):
                triangles.append((numbers[one], numbers[next_one], numbers[i, j, "centre"]))
    edges = {
        "inner": [(numbers[0, j], numbers[0, j + 1]) for j in range(arc)],
        "outer": [(numbers[radial, j], numbers[radial, j + 1]) for j in range(arc)],
        "bottom": [(numbers[i, 0], numbers[i + 1, 0]) for i in range(radial)],
        "left": [(numbers[i, arc], numbers[i + 1, arc]) for i in range(radial)],
    }
    return nodes, triangles, edges


for name, radial in (("coarse", 4), ("medium", 8), ("fine", 16)):
    nodes, triangles, edges = ring(radial)
    nodes = [f"{x:.15g} {y:.15g}" for x, y in nodes]
    gmsh.write(Path(__file__).parent / f"ring_{name}.msh", nodes, (0, 0, OUTER, OUTER), edges, triangles)

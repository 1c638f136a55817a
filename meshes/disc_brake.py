"""Writes disc_brake.msh beside itself: a ring between two pads, of tetrahedra that do not match.

    python3 meshes/disc_brake.py
"""

from math import cos, pi, sin
from pathlib import Path

import gmsh

HUB, RIM, THICKNESS = 0.07, 0.16, 0.01
INNER, OUTER, ANGLE, PAD = 0.10, 0.15, pi / 4, 0.01


def add_sector(mesh, region, sizes, cells):
    """Adds the part of a ring between two radii, angles and heights, of so many cells along each; a whole ring is closed."""
    whole = abs(sizes[1][1] - sizes[1][0] - 2 * pi) < 1e-9

    def node(*at):
        at = (at[0], at[1] % cells[1] if whole else at[1], at[2])
        radius, angle, height = (low + (high - low) * i / n for (low, high), i, n in zip(sizes, at, cells))
        return mesh.node((region, *at), (radius * cos(angle), radius * sin(angle), height))

    for a in range(cells[0]):
        for b in range(cells[1]):
            for c in range(cells[2]):
                mesh.add_brick(region, node, (a, b, c))


def radius_of(point):
    return (point[0] ** 2 + point[1] ** 2) ** 0.5


def at_height(height):
    return lambda p: abs(p[2] - height) < 1e-9


mesh = gmsh.Tetrahedra()
half = THICKNESS / 2
add_sector(mesh, "disc", ((HUB, RIM), (0, 2 * pi), (-half, half)), (4, 40, 2))
mesh.name_facets("disc", {
    "hub": lambda p: abs(radius_of(p) - HUB) < 1e-9,
    "front": at_height(half),
    "rear": at_height(-half),
})
for side, sign in (("front", 1), ("rear", -1)):
    angles = (pi / 2 - ANGLE / 2, pi / 2 + ANGLE / 2)
    heights = tuple(sorted((sign * half, sign * (half + PAD))))
    add_sector(mesh, f"{side} pad", ((INNER, OUTER), angles, heights), (5, 7, 2))
    mesh.name_facets(f"{side} pad", {
        f"{side} lining": at_height(sign * half),
        f"{side} piston": at_height(sign * (half + PAD)),
    })
mesh.write(Path(__file__).parent / "disc_brake.msh")

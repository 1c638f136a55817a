"""Writes ball_in_a_cup.msh beside itself: an eighth of a ball and of the thick shell around it, of tetrahedra that do not match.

    python3 meshes/ball_in_a_cup.py
"""

from math import pi, tan
from pathlib import Path

import gmsh

BALL, SHELL = 0.014, 0.021


def on_sphere(point, radius):
    """The point of the sphere in the direction of one on the surface of the unit cube; the cube's angles are made equal."""
    length = sum(x * x for x in point) ** 0.5
    return tuple(radius * x / length for x in point)


def place(a, b, c, n):
    """A node of a grid of n cells along each side of a cube, moved into a ball of radius 1."""
    most = max(a, b, c)
    if most == 0:
        return (0.0, 0.0, 0.0)
    even = tuple(tan(pi / 4 * x / most) for x in (a, b, c))
    return on_sphere(even, most / n)


def radius_of(point):
    return sum(x * x for x in point) ** 0.5


def down(point):
    """Into the eighth x >= 0, y >= 0, z <= 0."""
    return (point[0], point[1], 0.0 - point[2])


def add_ball(mesh, n):
    def node(a, b, c):
        return mesh.node(("ball", a, b, c), down(tuple(BALL * x for x in place(a, b, c, n))))

    for a in range(n):
        for b in range(n):
            for c in range(n):
                mesh.add_brick("ball", node, (a, b, c))
    mesh.name_facets("ball", {
        "head": lambda p: abs(radius_of(p) - BALL) < 1e-9,
        "equator": lambda p: p[2] == 0,
        "ball_left": lambda p: p[0] == 0,
        "ball_front": lambda p: p[1] == 0,
    })


def add_cup(mesh, n, layers):
    def node(key, layer):
        radius = BALL + (SHELL - BALL) * layer / layers
        return mesh.node(("cup", key, layer), down(on_sphere(place(*key, n), radius)))

    triangles = []
    for a in range(n):
        for b in range(n):
            for axis in range(3):
                def corner(i, j):
                    key = [i, j]
                    key.insert(axis, n)
                    return tuple(key)

                one, two, three, four = corner(a, b), corner(a + 1, b), corner(a + 1, b + 1), corner(a, b + 1)
                triangles += [(one, two, three), (one, three, four)]
    for layer in range(layers):
        for triangle in triangles:
            # Neighbours divide the side between them alike: by the order of its corners.
            low, middle, high = sorted(triangle)
            inner = [node(key, layer) for key in (low, middle, high)]
            outer = [node(key, layer + 1) for key in (low, middle, high)]
            for at in range(3):
                mesh.add_cell("cup", [*inner[at:], *outer[:at + 1]])
    mesh.name_facets("cup", {
        "socket": lambda p: abs(radius_of(p) - BALL) < 1e-9,
        "outside": lambda p: abs(radius_of(p) - SHELL) < 1e-9,
        "rim": lambda p: p[2] == 0,
        "cup_left": lambda p: p[0] == 0,
        "cup_front": lambda p: p[1] == 0,
    })


mesh = gmsh.Tetrahedra()
add_ball(mesh, 5)
add_cup(mesh, 4, 2)
mesh.write(Path(__file__).parent / "ball_in_a_cup.msh")

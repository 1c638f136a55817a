"""Writes meshes of quadratic triangles with curved sides beside itself: an elliptic membrane, a strip with a hole, Cook's panel, a
roller and a punch on a block, and a shell.

    python3 meshes/patches.py
"""

from math import cos, pi, sin
from pathlib import Path

import gmsh


class Mesh:
    """Triangles of mapped rectangles. The nodes of a body at the same place are one."""

    def __init__(self):
        self.places, self.numbers, self.triangles, self.edges = [], {}, [], {}

    def next_body(self):
        self.numbers = {}

    def node(self, point):
        key = tuple(round(axis, 9) + 0.0 for axis in point)
        if key not in self.numbers:
            self.places.append(key)
            self.numbers[key] = len(self.places)
        return self.numbers[key]

    def patch(self, grid, place, sides):
        """Adds the image of the unit square under `place`, with cells between these shares of its width and of its height, and these
        names of its left, right, lower and upper side."""
        columns, rows = (len(shares) - 1 for shares in grid)

        def point(*index):
            return place(*((shares[i // 2] + shares[(i + 1) // 2]) / 2 for shares, i in zip(grid, index)))

        def number(*index):
            return self.node(point(*index))

        def middle(*ends):
            one, other = sorted(ends, key=lambda end: end[1])
            if one[0] != other[0] and number(one[0], other[1]) == number(*other):
                # The upper side is one point, so that this diagonal is the side of a triangle.
                other = (one[0], other[1])
            return number(*((a + b) // 2 for a, b in zip(one, other)))

        def triangle(*corners):
            nodes = [number(*one) for one in corners]
            if len(set(nodes)) == 3:
                nodes += [middle(*pair) for pair in zip(corners, corners[1:] + corners[:1])]
                self.triangles.append(nodes)

        for i in range(0, 2 * columns, 2):
            for j in range(0, 2 * rows, 2):
                triangle((i, j), (i + 2, j), (i + 2, j + 2))
                triangle((i, j), (i + 2, j + 2), (i, j + 2))
        along = [[(i, j) for j in range(2 * rows + 1)] for i in (0, 2 * columns)]
        along += [[(i, j) for i in range(2 * columns + 1)] for j in (0, 2 * rows)]
        for name, line in zip(sides, along):
            if name:
                nodes = [number(*one) for one in line]
                self.edges.setdefault(name, []).extend(zip(nodes[::2], nodes[2::2], nodes[1::2]))

    def write(self, name):
        low, high = ([end(place[axis] for place in self.places) for axis in (0, 1)] for end in (min, max))
        nodes = [f"{x:.12g} {y:.12g}" for x, y in self.places]
        gmsh.write(Path(__file__).parent / f"{name}.msh", nodes, (*low, *high), self.edges, self.triangles)


def graded(cells, exponent=1.0):
    """The shares at which cells meet: powers of uniform ones."""
    return [(i / cells) ** exponent for i in range(cells + 1)]


def between(one, other, share):
    return tuple((1 - share) * a + share * b for a, b in zip(one, other))


def ellipse(across, up, share):
    """The point at a share of a quarter of an ellipse."""
    angle = share * pi / 2
    return (0.0 if share == 1 else across * cos(angle), 0.0 if share == 0 else up * sin(angle))


def membrane(cells):
    """A quarter of the elliptic membrane of NAFEMS LE1."""

    def place(u, v):
        return between(ellipse(2.0, 1.0, v), ellipse(3.25, 2.75, v), u)

    mesh = Mesh()
    mesh.patch((graded(4 * cells), graded(6 * cells)), place, ("inner", "outer", "bottom", "left"))
    return mesh


def strip(cells):
    """A quarter of a strip of the half width 2 and the half length 8 with a hole of the radius 1."""

    def around(u, v):
        return between(ellipse(1.0, 1.0, v), (2.0, 4 * v) if v < 0.5 else (4 - 4 * v, 2.0), u)

    mesh = Mesh()
    mesh.patch((graded(4 * cells, 1.5), graded(8 * cells)), around, ("hole", "", "bottom", "left"))
    beyond = (graded(6 * cells, 1.5), graded(4 * cells))
    mesh.patch(beyond, lambda u, v: (2 + 6 * u, 2 * v), ("", "right", "bottom", ""))
    return mesh


def panel(cells):
    """Cook's panel."""

    def place(u, v):
        return between(between((0, 0), (0, 44), v), between((48, 44), (48, 60), v), u)

    mesh = Mesh()
    mesh.patch((graded(4 * cells), graded(4 * cells)), place, ("left", "right", "bottom", "top"))
    return mesh


def roller(cells):
    """The right half of a half cylinder of the radius 50 on a block of 200 x 200, in mm, with small cells where they touch."""

    def around(u, v):
        x, y = ellipse(50.0, 50.0, u)
        return ((1 - v) * y, 50 - (1 - v) * x)

    mesh = Mesh()
    grid = (graded(12 * cells, 2.0), graded(10 * cells, 2.0))
    mesh.patch(grid, lambda u, v: (100 * u, -200 * v), ("block_left", "", "face", "base"))
    mesh.triangles = [[a, c, b, f, e, d] for a, b, c, d, e, f in mesh.triangles]
    mesh.next_body()
    mesh.patch((grid[0], graded(10 * cells, 1.5)), around, ("roller_left", "load", "surface", ""))
    return mesh


def punch(cells):
    """A section through a punch of the radius 50, whose edge has the radius 10, on a block of the radius 100, in mm, with small cells
    where its flat face ends."""

    def rounded(share):
        length = share * (90 + 5 * pi)
        angle = length / 10
        return (40 + 10 * sin(angle), 10 - 10 * cos(angle)) if angle < pi / 2 else (50.0, length + 10 - 5 * pi)

    mesh = Mesh()
    near = [1 - share for share in reversed(graded(6 * cells, 2.0))]
    far, down = graded(5 * cells, 2.0), graded(8 * cells, 2.0)
    mesh.patch((near, down), lambda u, v: (40 * u, -200 * v), ("block_axis", "", "surface", "base"))
    mesh.patch((far, down), lambda u, v: (40 + 60 * u, -200 * v), ("", "", "surface", "base"))
    mesh.next_body()
    near = [1 - share for share in reversed(graded(5 * cells, 2.0))]
    down = [1 - share for share in reversed(graded(7 * cells, 2.0))]
    mesh.patch((near, down), lambda u, v: (40 * u, 100 * (1 - v)), ("punch_axis", "", "load", "face"))
    mesh.patch((graded(2 * cells), down), lambda u, v: between((40, 100 * (1 - v)), rounded(1 - v), u), ("", "round", "load", ""))
    mesh.triangles = [[a, c, b, f, e, d] for a, b, c, d, e, f in mesh.triangles]
    return mesh


def cavity(cells):
    """A section through a shell of the radii 1 and 4."""

    def place(u, v):
        return between(ellipse(1.0, 1.0, v), ellipse(4.0, 4.0, v), u)

    mesh = Mesh()
    mesh.patch((graded(12 * cells), graded(4 * cells)), place, ("inner", "outer", "bottom", "left"))
    return mesh


if __name__ == "__main__":
    for size, cells in (("coarse", 1), ("medium", 2), ("fine", 4)):
        for mesh in (membrane, strip, panel, roller, punch, cavity):
            mesh(cells).write(f"{mesh.__name__}_{size}")

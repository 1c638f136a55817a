"""Writes thick_plate_coarse.msh, thick_plate_medium.msh and thick_plate_fine.msh beside itself: a quarter of the thick plate of NAFEMS
LE10, between two ellipses, of quadratic tetrahedra with curved edges.

    python3 meshes/thick_plate.py
"""

from itertools import permutations, product
from math import cos, pi, sin
from pathlib import Path

import gmsh

# Pairs of corners between which Gmsh's nodes of the edges of a tetrahedron and of a triangle lie.
EDGES = {4: ((0, 1), (1, 2), (2, 0), (3, 0), (2, 3), (1, 3)), 3: ((0, 1), (1, 2), (2, 0))}


def place(u, v, w):
    """The point at shares of the way from the inner to the outer ellipse, of the quarter and of the thickness of 0.6 m."""
    angle = v * pi / 2
    inner, outer = (2.0 * cos(angle), 1.0 * sin(angle)), (3.25 * cos(angle), 2.75 * sin(angle))
    x, y = ((1 - u) * a + u * b for a, b in zip(inner, outer))
    return (0.0 if v == 1 else x, 0.0 if v == 0 else y, 0.6 * w - 0.3)


def graded(index, end, exponent):
    """The share of the way at an index of the lattice of half cells: corners at powers of uniform shares, middles between them."""
    low, high = (((index + step) // 2 * 2 / end) ** exponent for step in (0, 1))
    return (low + high) / 2


def thickness(index, end):
    """Smaller cells near both faces."""
    half = end // 2
    return graded(index, half, 1.5) / 2 if index <= half else 1 - graded(end - index, half, 1.5) / 2


def odd(order):
    return sum(a > b for i, a in enumerate(order) for b in order[i + 1 :]) % 2


class Mesh:
    def __init__(self, cells):
        self.ends = [2 * count for count in cells]
        self.numbers = {}
        for one in product(*(range(end + 1) for end in self.ends)):
            self.numbers[one] = len(self.numbers) + 1

    def cell(self, corners):
        """The nodes of a tetrahedron or triangle with these corners in the lattice of half cells."""
        middles = [tuple((a + b) // 2 for a, b in zip(corners[i], corners[j])) for i, j in EDGES[len(corners)]]
        return [self.numbers[one] for one in (*corners, *middles)]

    def tetrahedra(self):
        """Six tetrahedra a box, around its diagonal; each follows three of its edges, and odd orders of the axes are turned over."""
        for origin in product(*(range(0, end, 2) for end in self.ends)):
            for order in permutations(range(3)):
                corners = [origin]
                for axis in order:
                    corners.append(tuple(one + 2 * (axis == place) for place, one in enumerate(corners[-1])))
                if odd(order):
                    corners[1], corners[2] = corners[2], corners[1]
                yield self.cell(corners)

    def facets(self, axis, level):
        """Two triangles for each box at this level of the lattice along the axis."""
        one, other = (a for a in range(3) if a != axis)
        for i, j in product(range(0, self.ends[one], 2), range(0, self.ends[other], 2)):
            def corner(a, b):
                point = [level] * 3
                point[one], point[other] = i + 2 * a, j + 2 * b
                return tuple(point)

            yield self.cell([corner(0, 0), corner(1, 0), corner(1, 1)])
            yield self.cell([corner(0, 0), corner(1, 1), corner(0, 1)])

    def write(self, name):
        sides = {"outer": (0, self.ends[0]), "bottom": (1, 0), "left": (1, self.ends[1]), "top": (2, self.ends[2])}
        groups = len(sides)
        lines = ["$MeshFormat", "4.1 0 8", "$EndMeshFormat", "$PhysicalNames", str(groups + 1)]
        lines += [f'2 {tag} "{side}"' for tag, side in enumerate(sides, 1)]
        lines += [f'3 {groups + 1} "body"', "$EndPhysicalNames", "$Entities", f"0 0 {groups} 1"]
        box = "0 0 -0.3 3.25 2.75 0.3"
        lines += [f"{tag} {box} 1 {tag} 0" for tag in range(1, groups + 1)]
        lines += [f"1 {box} 1 {groups + 1} 0", "$EndEntities"]
        total = len(self.numbers)
        lines += ["$Nodes", f"1 {total} 1 {total}", f"3 1 0 {total}", *map(str, range(1, total + 1))]
        for one in self.numbers:
            (i, j, k), ends = one, self.ends
            point = place(graded(i, ends[0], 2.0), graded(j, ends[1], 1.5), thickness(k, ends[2]))
            lines.append(" ".join(f"{axis:.12g}" for axis in point))
        lines.append("$EndNodes")
        blocks = [(2, tag, 9, list(self.facets(*side))) for tag, side in enumerate(sides.values(), 1)]
        gmsh.write_with_elements(Path(__file__).parent / f"{name}.msh", lines, [*blocks, (3, 1, 11, list(self.tetrahedra()))])


for size, cells in (("coarse", (2, 2, 2)), ("medium", (4, 4, 4)), ("fine", (8, 8, 8))):
    Mesh(cells).write(f"thick_plate_{size}")

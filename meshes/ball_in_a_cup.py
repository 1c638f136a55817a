"""Writes ball_in_a_cup.msh beside itself: an eighth of a ball and of the thick shell around it, of tetrahedra that do not match.

    python3 meshes/ball_in_a_cup.py
"""

from itertools import permutations
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


class Mesh:
    def __init__(self):
        self.nodes, self.numbers, self.cells, self.facets = [], {}, {}, {}

    def node(self, key, point):
        if key not in self.numbers:
            self.nodes.append(point)
            self.numbers[key] = len(self.nodes)
        return self.numbers[key]

    def add_cell(self, region, corners):
        points = [self.nodes[i - 1] for i in corners]
        sides = [[p - q for p, q in zip(point, points[0])] for point in points[1:]]
        (a, b, c), (d, e, f), (g, h, i) = sides
        if a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g) < 0:
            corners = [corners[1], corners[0], *corners[2:]]
        self.cells.setdefault(region, []).append(corners)

    def name_facets(self, region, names):
        """Names the facets of a region all of whose corners fulfil a condition."""
        count = {}
        for cell in self.cells[region]:
            for left in range(4):
                facet = tuple(corner for at, corner in enumerate(cell) if at != left)
                count.setdefault(frozenset(facet), []).append(facet)
        for facet in (same[0] for same in count.values() if len(same) == 1):
            for name, holds in names.items():
                if all(holds(self.nodes[i - 1]) for i in facet):
                    self.facets.setdefault(name, []).append(facet)


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
                for order in permutations(range(3)):
                    at, cell = [a, b, c], [node(a, b, c)]
                    for axis in order:
                        at[axis] += 1
                        cell.append(node(*at))
                    mesh.add_cell("ball", cell)
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


def write(mesh, path):
    names, regions = list(mesh.facets), list(mesh.cells)
    lines = ["$MeshFormat", "4.1 0 8", "$EndMeshFormat", "$PhysicalNames", str(len(names) + len(regions))]
    lines += [f'2 {tag} "{name}"' for tag, name in enumerate(names, 1)]
    lines += [f'3 {len(names) + tag} "{name}"' for tag, name in enumerate(regions, 1)]
    box = f"0 0 -{SHELL} {SHELL} {SHELL} 0"
    lines += ["$EndPhysicalNames", "$Entities", f"0 0 {len(names)} {len(regions)}"]
    lines += [f"{tag} {box} 1 {tag} 0" for tag in range(1, len(names) + 1)]
    lines += [f"{tag} {box} 1 {len(names) + tag} 0" for tag in range(1, len(regions) + 1)]
    count = len(mesh.nodes)
    lines += ["$EndEntities", "$Nodes", f"1 {count} 1 {count}", f"3 1 0 {count}"]
    lines += [str(tag) for tag in range(1, count + 1)]
    lines += [" ".join(f"{x:.15g}" for x in point) for point in mesh.nodes] + ["$EndNodes"]
    blocks = [(2, tag, 2, cells) for tag, cells in enumerate(mesh.facets.values(), 1)]
    blocks += [(3, tag, 4, cells) for tag, cells in enumerate(mesh.cells.values(), 1)]
    gmsh.write_with_elements(path, lines, blocks)


mesh = Mesh()
add_ball(mesh, 5)
add_cup(mesh, 4, 2)
write(mesh, Path(__file__).parent / "ball_in_a_cup.msh")

"""Writes half_ball.msh and ball.msh beside itself: sections through the axis of a ball, of second order, finer toward its lowest point.

    python3 meshes/ball.py
"""

from math import cos, hypot, pi, sin
from pathlib import Path

import gmsh

RADIUS = 0.05


def steps(count, ratio):
    """Numbers from 0 to 1 whose differences grow by `ratio` in all."""
    grown = [ratio ** (i / count) for i in range(count + 1)]
    return [(x - 1) / (ratio - 1) if ratio != 1 else i / count for i, x in enumerate(grown)]


def section(along, across, ratio):
    """A quarter of the disc below the equator, in three blocks: one around the centre, one from it to the lower half of the arc with
    `along` cells along the arc and `across` cells to it, and one to its upper half. Nodes, triangles, edges of arc and equator."""
    near, inner, corner = steps(along, ratio), 0.55 * RADIUS, 0.42 * RADIUS
    # Toward the arc cells become smaller.
    radial = [1 - x for x in reversed(steps(across, ratio))]
    upper = max(along // 2, 2)
    even = steps(upper, 1)
    nodes, cells = {}, []

    def between(one, two, share):
        return tuple((1 - share) * p + share * q for p, q in zip(one, two))

    def at(point):
        key = tuple(round(x / RADIUS, 9) + 0.0 for x in point)
        nodes.setdefault(key, point)
        return key

    def block(place, columns, rows):
        grid = [[at(place(i, j)) for j in range(rows + 1)] for i in range(columns + 1)]
        for i in range(columns):
            for j in range(rows):
                a, b, c, d = grid[i][j], grid[i + 1][j], grid[i + 1][j + 1], grid[i][j + 1]
                cells.extend([(a, b, c), (a, c, d)] if (i + j) % 2 else [(a, b, d), (b, c, d)])
        return grid

    centre, right, low, bottom = (0.0, 0.0), (inner, 0.0), (corner, -corner), (0.0, -inner)

    def on_arc(angle):
        return (RADIUS * sin(angle), -RADIUS * cos(angle))

    middle = block(
        lambda i, j: between(
            between(bottom, low, near[i]), between(centre, right, near[i]), even[j]), along, upper)
    lower = block(
        lambda i, j: between(on_arc(pi / 4 * near[i]), between(bottom, low, near[i]), 1 - radial[across - j]),
        along, across)
    outer = block(
        lambda i, j: between(between(low, right, even[j]), on_arc(pi / 4 * (1 + even[j])), radial[i]), across, upper)
    arc = [(lower[i][0], lower[i + 1][0]) for i in range(along)]
    arc += [(outer[across][j], outer[across][j + 1]) for j in range(upper)]
    equator = [(middle[i + 1][upper], middle[i][upper]) for i in range(along)]
    equator += [(outer[i + 1][upper], outer[i][upper]) for i in range(across)]
    return nodes, cells, arc, equator


def mirrored(nodes, triangles, arc):
    """Both halves of the disc."""

    def other(key):
        return key if abs(nodes[key][1]) < 1e-12 else (*key, "above")

    above = {other(key): (x, -y) for key, (x, y) in nodes.items()}
    triangles = triangles + [tuple(other(key) for key in reversed(cell)) for cell in triangles]
    return {**nodes, **above}, triangles, arc + [tuple(other(key) for key in reversed(edge)) for edge in arc]


def write(path, nodes, triangles, edges):
    """The mesh with the nodes on edges; those of the arc are on the circle."""
    on_arc = {frozenset(edge) for edge in edges["surface"]}
    numbers = {key: number for number, key in enumerate(nodes, 1)}
    places = list(nodes.values())
    middles = {}

    def middle(one, two):
        key = frozenset((one, two))
        if key not in middles:
            x, y = ((p + q) / 2 for p, q in zip(nodes[one], nodes[two]))
            if key in on_arc:
                scale = RADIUS / hypot(x, y)
                x, y = x * scale, y * scale
            places.append((x, y))
            middles[key] = len(places)
        return middles[key]

    def with_middles(cell):
        pairs = [cell] if len(cell) == 2 else zip(cell, cell[1:] + cell[:1])
        return [numbers[key] for key in cell] + [middle(*pair) for pair in pairs]

    edges = {name: [with_middles(edge) for edge in cells] for name, cells in edges.items()}
    triangles = [with_middles(cell) for cell in triangles]
    nodes = [f"{x:.12g} {y:.12g}" for x, y in places]
    gmsh.write(path, nodes, (0, -RADIUS, RADIUS, RADIUS), edges, triangles)


here = Path(__file__).parent
nodes, triangles, arc, equator = section(24, 14, 16)
write(here / "half_ball.msh", nodes, triangles, {"surface": arc, "equator": equator})
nodes, triangles, arc, _ = section(16, 8, 8)
nodes, triangles, arc = mirrored(nodes, triangles, arc)
write(here / "ball.msh", nodes, triangles, {"surface": arc})

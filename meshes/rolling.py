"""Writes two equal blocks, one on the other, with small cells where a roller passes, in millimetres: linear triangles, to which the solver
adds the middles of their sides. A rectangle of equal cells lies at the way of the roller; around it, rows of cells along its left, lower
and right side grow toward the sides of the block, and some of them merge in pairs.

    python3 meshes/rolling.py
"""

from pathlib import Path

import gmsh

HALF_WIDTH, HEIGHT = 40.0, 40.0
WAY = 3.2
# Rows of equal cells: a power of two, because the cells along the sides of the rectangle merge, too.
ROWS = 8


class Block:
    """Nodes and triangles on one side of the surface y = 0."""

    def __init__(self, mesh, side):
        self.mesh, self.side = mesh, side

    def node(self, x, depth):
        key = (round(x, 9) + 0.0, round(self.side * depth, 9) + 0.0, self.side)
        if key not in self.mesh.numbers:
            self.mesh.nodes.append(f"{key[0]:.9g} {key[1]:.9g}")
            self.mesh.numbers[key] = len(self.mesh.nodes)
        return self.mesh.numbers[key]

    def triangle(self, *corners):
        self.mesh.triangles.append(corners if self.side < 0 else corners[::-1])

    def quadrilateral(self, corners, leans):
        """Corners counterclockwise in the lower block; the diagonal starts at the first or at the second of them."""
        a, b, c, d = corners
        for cell in ((a, b, d), (b, c, d)) if leans else ((a, b, c), (a, c, d)):
            self.triangle(*cell)

    def name(self, name, nodes):
        self.mesh.edges.setdefault(name, []).extend(zip(nodes, nodes[1:]))


class Mesh:
    def __init__(self):
        self.nodes, self.numbers, self.edges, self.triangles = [], {}, {}, []


def around(size, columns, share, step):
    """The nodes of a row around the rectangle, every so many cells, at this share of the way to the sides of the block."""
    inner = [(-WAY, size * j) for j in range(ROWS)]
    inner += [(size * i - WAY, size * ROWS) for i in range(columns)]
    inner += [(WAY, size * j) for j in range(ROWS, -1, -1)]
    outer = [(-HALF_WIDTH, HEIGHT * j / ROWS) for j in range(ROWS)]
    outer += [(HALF_WIDTH * (2 * i / columns - 1), HEIGHT) for i in range(columns)]
    outer += [(HALF_WIDTH, HEIGHT * j / ROWS) for j in range(ROWS, -1, -1)]
    pairs = list(zip(inner, outer))[::step]
    return [tuple((1 - share) * p + share * q for p, q in zip(*pair)) for pair in pairs]


def rolling(size, merges):
    mesh = Mesh()
    columns = round(2 * WAY / size)
    for side, touching, held in ((-1, "lower", "base"), (1, "upper", "top")):
        block = Block(mesh, side)
        places = [size * i - WAY for i in range(columns + 1)]
        grid = [[block.node(x, size * j) for x in places] for j in range(ROWS + 1)]
        for above, below in zip(grid, grid[1:]):
            for i in range(columns):
                block.quadrilateral((below[i], below[i + 1], above[i + 1], above[i]), i >= columns / 2)
        reach, height, step, last = 0.0, size, 1, around(size, columns, 0.0, 1)
        left, right = [last[0]], [last[-1]]
        while reach < HEIGHT:
            merged = step < 2**merges and height >= 2 * step * size
            height *= 1.35
            reach += height
            if reach > HEIGHT - 0.7 * height:
                reach = HEIGHT
            step *= 2 if merged else 1
            row = around(size, columns, reach / HEIGHT, step)
            far, near = ([block.node(*place) for place in places] for places in (row, last))
            for i in range(len(far) - 1):
                if merged:
                    p, q, r = near[2 * i : 2 * i + 3]
                    block.triangle(far[i], q, p)
                    block.triangle(far[i], far[i + 1], q)
                    block.triangle(far[i + 1], r, q)
                else:
                    block.quadrilateral((far[i], far[i + 1], near[i + 1], near[i]), i >= (len(far) - 1) / 2)
            last = row
            left.insert(0, row[0])
            right.append(row[-1])
        surface = [block.node(*place) for place in left] + grid[0][1:-1] + [block.node(*place) for place in right]
        block.name(touching, surface)
        block.name(held, [block.node(*place) for place in row if place[1] > HEIGHT - 1e-9])
    return mesh


def write(name, mesh):
    box = (-HALF_WIDTH, -HEIGHT, HALF_WIDTH, HEIGHT)
    gmsh.write(Path(__file__).parent / f"{name}.msh", mesh.nodes, box, mesh.edges, mesh.triangles)
    print(name, len(mesh.nodes), len(mesh.triangles))


if __name__ == "__main__":
    for name, size in (("coarse", 0.2), ("medium", 0.1), ("fine", 0.05)):
        write(f"rolling_{name}", rolling(size, 3))

"""Writes a rectangle with a fault inside, fault.msh beside itself: cells of 750 m along the fault, larger ones away from it.

    python3 meshes/fault.py
"""

from pathlib import Path

import gmsh

TIP = 6e3


def main():
    along = [750.0 * i for i in range(-12, 13)]
    beyond = [9e3 + 6e3 * (i / 4) ** 1.3 for i in range(1, 5)]
    columns = [-x for x in reversed(beyond)] + along + beyond
    above = [8e3 * (i / 8) ** 1.4 for i in range(1, 9)]
    rows = [-y for y in reversed(above)] + [0.0] + above

    def node(i, j):
        return 1 + i + j * len(columns)

    nodes = [f"{x:.12g} {y:.12g}" for y in rows for x in columns]
    last_column, last_row, middle = len(columns) - 1, len(rows) - 1, len(above)
    triangles = []
    for j in range(last_row):
        for i in range(last_column):
            low, high = [node(i, j), node(i + 1, j)], [node(i, j + 1), node(i + 1, j + 1)]
            # Mirror images about the fault.
            if j < middle:
                triangles += [(*low, high[0]), (low[1], high[1], high[0])]
            else:
                triangles += [(*low, high[1]), (low[0], high[1], high[0])]
    across = [[(node(i, j), node(i, j + 1)) for j in range(last_row)] for i in (0, last_column)]
    flat = [[(node(i, j), node(i + 1, j)) for i in range(last_column)] for j in (0, last_row)]
    fault = [(node(i, middle), node(i + 1, middle)) for i in range(last_column) if -TIP <= columns[i] < TIP]
    edges = {"left": across[0], "right": across[1], "bottom": flat[0], "top": flat[1], "fault": fault}
    box = (columns[0], rows[0], columns[-1], rows[-1])
    gmsh.write(Path(__file__).parent / "fault.msh", nodes, box, edges, triangles)


main()

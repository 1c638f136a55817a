"""Writes belt_coarse.msh, belt_medium.msh and belt_fine.msh beside itself: quarters of a thin ring, one cell thick, in Gmsh's format 2.2.

    python3 meshes/belt.py
"""

from math import cos, pi, sin
from pathlib import Path

INNER, OUTER = 1.0, 1.01
NAMES = ("inner", "outer", "low end", "high end")


def belt(along):
    """Nodes and lines of elements of a belt with this number of cells along the arc, each of two triangles."""
    angles = [pi / 2 * i / along for i in range(along + 1)]
    nodes = [(radius * cos(angle), radius * sin(angle)) for angle in angles for radius in (INNER, OUTER)]
    inner = [2 * i + 1 for i in range(along + 1)]
    edges = [(1, a, b) for a, b in zip(inner, inner[1:])] + [(2, a + 1, b + 1) for a, b in zip(inner, inner[1:])]
    edges += [(3, 1, 2), (4, inner[-1], inner[-1] + 1)]
    cells = [(a, a + 1, b + 1) for a, b in zip(inner, inner[1:])] + [(a, b + 1, b) for a, b in zip(inner, inner[1:])]
    lines = [f"1 2 {tag} {tag} {a} {b}" for tag, a, b in edges] + [f"2 2 5 5 {a} {b} {c}" for a, b, c in cells]
    return nodes, lines


for name, along in (("coarse", 24), ("medium", 48), ("fine", 96)):
    nodes, lines = belt(along)
    text = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$PhysicalNames", "5"]
    text += [f'1 {tag} "{boundary}"' for tag, boundary in enumerate(NAMES, 1)] + ['2 5 "belt"', "$EndPhysicalNames"]
    text += ["$Nodes", str(len(nodes))] + [f"{i} {x:.15g} {y:.15g} 0" for i, (x, y) in enumerate(nodes, 1)]
    text += ["$EndNodes", "$Elements", str(len(lines))] + [f"{i} {line}" for i, line in enumerate(lines, 1)]
    (Path(__file__).parent / f"belt_{name}.msh").write_text("\n".join(text + ["$EndElements"]) + "\n")

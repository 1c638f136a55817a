"""Files of Gmsh's format 4.1: plane meshes of one region, `body`, meshes of tetrahedra, and the elements of any mesh."""

from itertools import permutations


def write(path, nodes, box, edges, triangles):
    """Nodes are texts of x and y, named edges and triangles lists of the numbers of their nodes from 1, with the middles of their sides
    in order 2. `box` is the least and the largest x and y."""
    groups = len(edges)
    box = "{:g} {:g} 0 {:g} {:g} 0".format(*box)
    lines = ["$MeshFormat", "4.1 0 8", "$EndMeshFormat", "$PhysicalNames", str(groups + 1)]
    lines += [f'1 {tag} "{name}"' for tag, name in enumerate(edges, 1)]
    lines += [f'2 {groups + 1} "body"', "$EndPhysicalNames", "$Entities", f"0 {groups} 1 0"]
    lines += [f"{tag} {box} 1 {tag} 0" for tag in range(1, groups + 1)]
    lines += [f"1 {box} 1 {groups + 1} 0", "$EndEntities"]
    lines += ["$Nodes", f"1 {len(nodes)} 1 {len(nodes)}", f"2 1 0 {len(nodes)}"]
    lines += [str(tag) for tag in range(1, len(nodes) + 1)]
    lines += [f"{node} 0" for node in nodes] + ["$EndNodes"]
    kinds = (8, 9) if len(triangles[0]) == 6 else (1, 2)
    blocks = [(1, tag, kinds[0], cells) for tag, cells in enumerate(edges.values(), 1)] + [(2, 1, kinds[1], triangles)]
    write_with_elements(path, lines, blocks)


def write_with_elements(path, lines, blocks):
    """Writes these lines and blocks of elements, each with its dimension, the tag of its entity, Gmsh's number of its type, and lists of
    the numbers of nodes."""
    total = sum(len(cells) for *_, cells in blocks)
    lines += ["$Elements", f"{len(blocks)} {total} 1 {total}"]
    number = 0
    for dimension, tag, kind, cells in blocks:
        lines.append(f"{dimension} {tag} {kind} {len(cells)}")
        for cell in cells:
            number += 1
            lines.append(" ".join(map(str, (number, *cell))))
    path.write_text("\n".join(lines + ["$EndElements"]) + "\n")


class Tetrahedra:
    """Nodes with keys, cells of regions, and facets with names."""

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

    def add_brick(self, region, node, at):
        """Adds the six tetrahedra between the node of these three numbers and that of the next ones."""
        for order in permutations(range(3)):
            corner = list(at)
            cell = [node(*corner)]
            for axis in order:
                corner[axis] += 1
                cell.append(node(*corner))
            self.add_cell(region, cell)

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

    def write(self, path):
        names, regions = list(self.facets), list(self.cells)
        box = "{:g} {:g} {:g} {:g} {:g} {:g}".format(*(end(axis) for end in (min, max) for axis in zip(*self.nodes)))
        lines = ["$MeshFormat", "4.1 0 8", "$EndMeshFormat", "$PhysicalNames", str(len(names) + len(regions))]
        lines += [f'2 {tag} "{name}"' for tag, name in enumerate(names, 1)]
        lines += [f'3 {len(names) + tag} "{name}"' for tag, name in enumerate(regions, 1)]
        lines += ["$EndPhysicalNames", "$Entities", f"0 0 {len(names)} {len(regions)}"]
        lines += [f"{tag} {box} 1 {tag} 0" for tag in range(1, len(names) + 1)]
        lines += [f"{tag} {box} 1 {len(names) + tag} 0" for tag in range(1, len(regions) + 1)]
        count = len(self.nodes)
        lines += ["$EndEntities", "$Nodes", f"1 {count} 1 {count}", f"3 1 0 {count}"]
        lines += [str(tag) for tag in range(1, count + 1)]
        lines += [" ".join(f"{x:.15g}" for x in point) for point in self.nodes] + ["$EndNodes"]
        blocks = [(2, tag, 2, cells) for tag, cells in enumerate(self.facets.values(), 1)]
        blocks += [(3, tag, 4, cells) for tag, cells in enumerate(self.cells.values(), 1)]
        write_with_elements(path, lines, blocks)

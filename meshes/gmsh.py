"""Files of Gmsh's format 4.1: plane meshes of one region, `body`, and the elements of any mesh."""


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

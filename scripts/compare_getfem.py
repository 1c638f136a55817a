#!/usr/bin/env python3
"""Contact between two deformable bodies, beside GetFEM on the same meshes: the tables of docs/verification/two-bodies-getfem.md.

    /usr/bin/python3 scripts/compare_getfem.py [--write] [patch] [inclined] [boxes] [cylinders] [friction] [spheres]

Each case writes a mesh file, which both programs read, runs the solver (SOLVER, target/release/solver by default) on one rank and GetFEM's
Python interface on one thread, and prints a table; `--write` puts it into the page. On Debian and Ubuntu, GetFEM and what reads the
files of the solver are `apt-get install python3-getfem python3-h5py` (GetFEM 5.4.2 on Debian 12), which the Python of the system finds.
"""

import csv
import datetime
import json
import os
import subprocess
import sys
import tempfile
import time
from math import acos, pi, sqrt
from pathlib import Path

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1")
os.environ.update(OMPI_ALLOW_RUN_AS_ROOT="1", OMPI_ALLOW_RUN_AS_ROOT_CONFIRM="1")

try:
    import getfem as gf
    import h5py
    import numpy as np
except ImportError as error:
    sys.exit(f"{error}: apt-get install python3-getfem python3-h5py, then call this script by the system's Python, /usr/bin/python3")

ROOT = Path(__file__).resolve().parent.parent
SOLVER = Path(os.environ.get("SOLVER", ROOT / "target/release/solver")).resolve()
PAGE = ROOT / "docs/verification/two-bodies-getfem.md"
BODIES = ("lower", "upper")


# Meshes


def grid(name, shares, place):
    """Triangles or tetrahedra of the image of the unit square or cube under `place`, with cells between these shares of its sides, and
    the facets of its sides by name."""
    dimension = len(shares)
    counts = [len(one) for one in shares]
    index = lambda at: sum(i * int(np.prod(counts[:axis])) for axis, i in enumerate(at))
    nodes = [place(*(one[i] for one, i in zip(shares, reversed(at)))) for at in np.ndindex(*reversed(counts))]
    orders = [(0, 1), (1, 0)] if dimension == 2 else [(0, 1, 2), (0, 2, 1), (1, 0, 2), (1, 2, 0), (2, 0, 1), (2, 1, 0)]
    sides = (("left", "right"), ("bottom", "top")) if dimension == 2 else (("left", "right"), ("front", "back"), ("bottom", "top"))
    cells, facets = [], {f"{name}_{side}": [] for pair in sides for side in pair}
    for first in np.ndindex(*(count - 1 for count in counts)):
        for order in orders:
            path = [first]
            for axis in order:
                path.append(tuple(i + (a == axis) for a, i in enumerate(path[-1])))
            corners = [index(at) for at in path]
            edges = [np.subtract(nodes[corner], nodes[corners[0]]) for corner in corners[1:]]
            cells.append(corners if np.linalg.det(edges) > 0 else [*corners[:-2], corners[-1], corners[-2]])
            for axis in range(dimension):
                for end, side in zip((0, counts[axis] - 1), sides[axis]):
                    on = [index(at) for at in path if at[axis] == end]
                    if len(on) == dimension:
                        facets[f"{name}_{side}"].append(on)
    return {"nodes": nodes, "cells": cells, "facets": facets}


def write_mesh(path, grids):
    """The bodies as one file of Gmsh's format 2.2, whose nodes at the same place in two bodies are two. Returns the numbers of the
    groups by name."""
    dimension = len(grids["lower"]["nodes"][0])
    groups, nodes, elements = {}, [], []
    for name, one in grids.items():
        for group, parts in [*one["facets"].items(), (name, one["cells"])]:
            groups[group] = len(groups) + 1
            kind = {2: 1, 3: 2, 4: 4}[len(parts[0])] if group != name or dimension == 3 else 2
            tag = groups[group]
            elements += [f"{kind} 2 {tag} {tag} " + " ".join(str(len(nodes) + 1 + node) for node in part) for part in parts]
        nodes += [" ".join(f"{axis:.15g}" for axis in (*place, 0.0)[:3]) for place in one["nodes"]]
    lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$PhysicalNames", str(len(groups))]
    lines += [f'{dimension - (name not in grids)} {tag} "{name}"' for name, tag in groups.items()]
    lines += ["$EndPhysicalNames", "$Nodes", str(len(nodes))]
    lines += [f"{number} {place}" for number, place in enumerate(nodes, 1)] + ["$EndNodes", "$Elements", str(len(elements))]
    lines += [f"{number} {element}" for number, element in enumerate(elements, 1)] + ["$EndElements"]
    path.write_text("\n".join(lines) + "\n")
    return groups


def graded(cells, exponent=1.0):
    return [(i / cells) ** exponent for i in range(cells + 1)]


def both_ways(cells, exponent):
    """Graded from the middle toward both ends: small cells in the middle."""
    half = graded(cells // 2, exponent)
    return [0.5 - one / 2 for one in reversed(half)] + [0.5 + one / 2 for one in half[1:]]


def toward_end(shares):
    return [1 - one for one in reversed(shares)]


# The solver


def run_solver(folder, job):
    """Runs the text of a job in `folder`. Returns the output folder, the summary and the seconds of the whole process."""
    path = folder / "job.toml"
    path.write_text(job + '\n[output]\nfolder = "out"\nalso = ["contact_pressure"]\n')
    start = time.perf_counter()
    done = subprocess.run([SOLVER, "run", path, "--force"], capture_output=True, text=True, timeout=1800)
    seconds = time.perf_counter() - start
    if done.returncode:
        sys.exit(f"{job}\n{done.stdout}{done.stderr}")
    return folder / "out", json.loads((folder / "out/summary.json").read_text()), seconds


def rows(path):
    with open(path) as file:
        return list(csv.DictReader(file))


class Fields:
    """The last fields of a run: places and displacements of the nodes of each body, stresses of all cells."""

    def __init__(self, out, dimension):
        with h5py.File(out / "fields.vtkhdf") as file:
            root = file["VTKHDF"]
            last = lambda kind, name: root[f"{kind}Data/{name}"][root[f"Steps/{kind}DataOffsets/{name}"][-1] :]
            self.places = root["Points"][: int(root["NumberOfPoints"][0]), :dimension]
            self.displacements = last("Point", "displacement")[:, :dimension]
            self.stresses = last("Cell", "stress")
            ends, corners = root["Offsets"][:], root["Connectivity"][:]
            self.cells = [corners[a:b] for a, b in zip(ends[:-1], ends[1:])]

    def of_body(self, above):
        """Places and displacements of the nodes of one body: those of cells whose centre is above the interface or not."""
        mine = [cell for cell in self.cells if above(self.places[cell].mean(axis=0))]
        nodes = np.unique(np.concatenate(mine))
        return self.places[nodes], self.displacements[nodes]


# GetFEM


class Peer:
    """Two bodies in GetFEM's model, with a multiplier on the lower side of the upper one."""

    def __init__(self, path, groups, order, moduli, nu):
        start = time.perf_counter()
        self.groups, self.order = groups, order
        whole = gf.Mesh("import", "gmsh", str(path))
        self.dimension = whole.dim()
        self.model = gf.Model("real")
        self.meshes, self.spaces, self.rules = {}, {}, {}
        for name, other in zip(BODIES, reversed(BODIES)):
            mesh = gf.Mesh("clone", whole)
            mesh.del_convex(whole.region(groups[other])[0])
            space = gf.MeshFem(mesh, self.dimension)
            space.set_classical_fem(order)
            rule = gf.MeshIm(mesh, gf.Integ("IM_TRIANGLE(4)" if self.dimension == 2 else "IM_TETRAHEDRON(3)"))
            self.meshes[name], self.spaces[name], self.rules[name] = mesh, space, rule
            shear = moduli[name] / (2 * (1 + nu))
            self.model.add_fem_variable("u_" + name, space)
            self.model.add_initialized_data("shear_" + name, shear)
            self.model.add_initialized_data("lame_" + name, 2 * shear * nu / (1 - 2 * nu))
            self.model.add_isotropic_linearized_elasticity_brick(rule, "u_" + name, "lame_" + name, "shear_" + name)
        self.seconds = time.perf_counter() - start
        self.iterations = 0

    def data(self, name, value):
        self.model.add_initialized_data(name, value)
        return name

    def fix(self, group, axis, value="0"):
        """Holds a component on a boundary, or moves it by the expression `value`."""
        name, multiplier = group.split("_")[0], f"m_{group}_{axis}"
        space = gf.MeshFem(self.meshes[name], 1)
        space.set_classical_fem(self.order)
        self.model.add_filtered_fem_variable(multiplier, space, self.groups[group])
        u = f"u_{name}({axis + 1})"
        self.model.add_linear_term(
            self.rules[name], f"({u} - ({value}))*Test_{multiplier} + {multiplier}*Test_{u}", self.groups[group], True
        )

    def load(self, group, traction):
        name = group.split("_")[0]
        force = self.data("load_" + group, traction)
        self.model.add_source_term(self.rules[name], f"{force}.Test_u_{name}", self.groups[group])

    def multiplier(self, components=1, order=1, start=0.0):
        """The multiplier: the contact pressure, or the traction of the lower body on the upper one."""
        self.pressures = gf.MeshFem(self.meshes["upper"], components)
        self.pressures.set_classical_fem(order)
        self.model.add_filtered_fem_variable("p", self.pressures, self.groups["upper_bottom"])
        if np.any(start):
            values = np.tile(start, self.model.variable("p").size // np.size(start))
            self.model.set_variable("p", values)

    def rule(self, parts=1):
        """An integration rule for the contact, on this number of parts of an edge."""
        name = "IM_TRIANGLE(6)" if self.dimension == 2 else "IM_TETRAHEDRON(6)"
        return gf.MeshIm(self.meshes["upper"], gf.Integ(f"IM_STRUCTURED_COMPOSITE({name},{parts})" if parts > 1 else name))

    def brick(self, r, parts):
        """GetFEM's own brick for bodies whose meshes do not fit, the symmetric augmented Lagrangian."""
        self.multiplier()
        self.sign = -1.0
        self.data("r", r)
        regions = [self.groups[group] for group in ("upper_bottom", "lower_top")]
        self.model.add_integral_contact_between_nonmatching_meshes_brick(
            self.rule(parts), "u_upper", "u_lower", "p", "r", *regions, 2
        )

    def across(self):
        """The point of the lower body below a point of the upper one: the same place of the undeformed bodies."""
        self.model.add_interpolate_transformation_from_expression("across", self.meshes["upper"], self.meshes["lower"], "X")

    def contact(self, r, gap, start, parts=1):
        """The same formulation with a given gap, in the language of weak forms."""
        self.across()
        self.multiplier(start=start)
        self.sign = 1.0
        self.data("r", r)
        closer = f"((u_upper - Interpolate(u_lower, across)).Normal - ({gap}))"
        pressure = f"pos_part(p + r*{closer})"
        self.model.add_nonlinear_term(
            self.rule(parts),
            f"{pressure}*((Test_u_upper - Interpolate(Test_u_lower, across)).Normal) - (1/r)*(p - {pressure})*Test_p",
            self.groups["upper_bottom"],
        )

    def friction(self, r, gap, coefficient, start, parts=1):
        """Coulomb friction; the slip is that since the data `w`, the jump of displacement at the last step."""
        self.across()
        self.multiplier(components=self.dimension, start=start)
        self.data("r", r)
        self.model.add_fem_data("before_upper", self.spaces["upper"])
        self.model.add_fem_data("before_lower", self.spaces["lower"])
        jump = "(u_upper - Interpolate(u_lower, across))"
        slip = f"({jump} - (before_upper - Interpolate(before_lower, across)))"
        free = f"(({gap}) - {jump}.Normal)"
        traction = f"Coulomb_friction_coupled_projection(p, Normal, {slip}, {free}, {coefficient}, r)"
        self.model.add_nonlinear_term(
            self.rule(parts),
            f"-p.(Test_u_upper - Interpolate(Test_u_lower, across)) - (1/r)*(p - {traction}).Test_p",
            self.groups["upper_bottom"],
        )

    def solve(self):
        """Newton's method, as GetFEM's own examples of contact call it. Adds iterations and seconds."""
        start = time.perf_counter()
        iterations, converged = self.model.solve(
            "max_res", 1e-9, "max_iter", 100, "lsolver", "mumps", "lsearch", "simplest", "alpha min", 0.8
        )
        self.seconds += time.perf_counter() - start
        self.iterations += int(iterations)
        if not converged:
            raise RuntimeError(f"GetFEM's Newton's method has not converged in {iterations} iterations")

    def profile(self):
        """Places and values of the multiplier at its nodes on the boundary."""
        numbers = self.pressures.basic_dof_on_region(self.groups["upper_bottom"])
        places = self.pressures.basic_dof_nodes()[:, numbers]
        space = gf.MeshFem(self.meshes["upper"], 1)
        return places.T, self.model.variable("p")

    def stresses(self):
        """The stresses at the centres of all cells of a body after the other, each a matrix."""
        found = []
        for name in BODIES:
            space = gf.MeshFem(self.meshes[name], 1)
            space.set_classical_discontinuous_fem(0)
            eye = f"Id({self.dimension})"
            stress = f"lame_{name}*Div_u_{name}*{eye} + 2*shear_{name}*Sym(Grad_u_{name})"
            found.append(self.model.interpolation(stress, space).reshape(-1, self.dimension, self.dimension))
        return np.concatenate(found)

    def displacements(self, name):
        """Places and displacements of the nodes of a body."""
        places = self.spaces[name].basic_dof_nodes()[:, :: self.dimension].T
        return places, self.model.variable("u_" + name).reshape(-1, self.dimension)


def largest_difference(ours, peer):
    """The largest difference of displacements at the nodes of both programs, which are at the same places, relative to the largest
    displacement."""
    order = lambda places: np.lexsort(np.round(places, 9).T)
    (places, values), (others, other_values) = ours, peer
    mine, theirs = order(places), order(others)
    if len(mine) != len(theirs) or not np.allclose(places[mine], others[theirs], atol=1e-8):
        sys.exit("the nodes of the two programs differ")
    return np.abs(values[mine] - other_values[theirs]).max()


# Cases


HEAD = """\
[mesh]
file = "bodies.msh"
order = {order}

[material]
hypothesis = "plane_strain"

[material.elasticity]
youngs_modulus = {lower}
poisson_ratio = {nu}

[[region]]
name = "upper"
[region.material.elasticity]
youngs_modulus = {upper}
poisson_ratio = {nu}

[[contact]]
on = ["upper_bottom"]
against = ["lower_top"]
side = "on"
normal.unilateral = {{ {gap} }}
{more}
"""


def head(order, moduli, nu, dimension=2, gap="", more=""):
    text = HEAD.format(order=order, nu=nu, gap=gap, more=more, **moduli)
    return text if dimension == 2 else text.replace('hypothesis = "plane_strain"\n', "")


def support(group, axis, displacement=None):
    text = f'\n[[support]]\non = ["{group}"]\nfix = ["{"xyz"[axis]}"]\n'
    return text + (f'displacement = ["{displacement}"]\n' if displacement else "")


def traction(group, value):
    return f'\n[[traction]]\non = ["{group}"]\nvalue = {list(value)}\n'


def time_of(end, step):
    return f'\n[time]\nscheme = "implicit_euler"\nend = {end}\nstep = {step}\n'


PATCH = {"modulus": 2e6, "nu": 0.3, "pressure": 1e5}


def patch(slope, dimension, order, cells):
    """One row: two blocks under a uniform pressure from all sides."""
    modulus, nu, pressure = PATCH.values()
    interface = lambda x: 1 + slope * (x - 0.5)

    def lower(*at):
        return (*at[:-1], at[-1] * interface(at[0]))

    def upper(*at):
        return (*at[:-1], 2 - (1 - at[-1]) * (2 - interface(at[0])))

    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        grids = {
            name: grid(name, [graded(n) for n in counts], place)
            for name, counts, place in zip(BODIES, cells, (lower, upper))
        }
        groups = write_mesh(folder / "bodies.msh", grids)
        held = ["left"] if dimension == 2 else ["left", "front"]
        pressed = ["right"] if dimension == 2 else ["right", "back"]
        moduli = dict.fromkeys(BODIES, modulus)
        fixed = [(f"{name}_{side}", axis) for name in BODIES for axis, side in enumerate(held)]
        fixed.append(("lower_bottom", dimension - 1))
        axis_of = {side: axis for axis, side in enumerate(pressed)} | {"top": dimension - 1}
        loads = [(f"{name}_{side}", axis_of[side]) for name in BODIES for side in pressed]
        loads.append(("upper_top", dimension - 1))
        along = lambda axis: [-pressure * float(a == axis) for a in range(dimension)]

        job = head(order, moduli, nu, dimension)
        job += "".join(support(*one) for one in fixed)
        job += "".join(traction(group, along(axis)) for group, axis in loads)
        job += time_of(1.0, 1.0) + '\n[[output.profile]]\non = "upper_bottom"\n'
        out, summary, _ = run_solver(folder, job)
        stresses = Fields(out, dimension).stresses
        inplane = [0, 1] if dimension == 2 else [0, 1, 2]
        shears = [k for k in range(stresses.shape[1]) if k not in (0, 1, 2)]
        ours = [
            max(np.abs(stresses[:, inplane] + pressure).max(), np.abs(stresses[:, shears]).max()) / pressure,
            max(abs(float(row["contact_pressure"]) / pressure - 1) for row in rows(out / "profiles.csv")),
        ]
        results = [ours]
        for parts in (1, 8 if dimension == 2 else 2):
            peer = Peer(folder / "bodies.msh", groups, order, moduli, nu)
            for one in fixed:
                peer.fix(*one)
            for group, axis in loads:
                peer.load(group, along(axis))
            peer.brick(modulus, parts)
            peer.solve()
            errors = peer.stresses() + pressure * np.eye(dimension)
            results.append(
                [np.abs(errors).max() / pressure, np.abs(peer.sign * peer.profile()[1] / pressure - 1).max()]
            )
        return results


def patches(write):
    print(patch(0.0, 2, 1, ((5, 4), (7, 5))))
    print(patch(0.0, 2, 2, ((5, 4), (7, 5))))
    print(patch(0.4, 2, 1, ((5, 4), (7, 5))))
    print(patch(0.4, 2, 2, ((5, 4), (7, 5))))
    print(patch(0.0, 3, 1, ((3, 3, 2), (4, 5, 2))))
    print(patch(0.0, 3, 2, ((3, 3, 2), (4, 5, 2))))


if __name__ == "__main__":
    gf.util_trace_level(0)
    gf.util_warning_level(0)
    patches(False)

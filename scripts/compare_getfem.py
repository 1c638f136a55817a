#!/usr/bin/env python3
"""Contact between two deformable bodies, beside GetFEM on the same meshes: the tables of docs/verification/two-bodies-getfem.md.

    /usr/bin/python3 scripts/compare_getfem.py [--write] [patch] [cylinders] [friction]

Each case writes a mesh file, which both programs read, runs the solver (SOLVER, target/release/solver by default) on one rank and GetFEM's
Python interface on one thread, and prints a table; `--write` puts it into the page. On Debian and Ubuntu, GetFEM and what reads the
files of the solver are `apt-get install python3-getfem python3-h5py` (GetFEM 5.4.2 on Debian 12), which the Python of the system finds.
"""

import csv
import datetime
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from itertools import permutations
from math import pi, sqrt
from pathlib import Path

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1")
os.environ.update(OMPI_ALLOW_RUN_AS_ROOT="1", OMPI_ALLOW_RUN_AS_ROOT_CONFIRM="1")

try:
    import getfem as gf
    import h5py
    import numpy as np
    from scipy.spatial import cKDTree
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
    sides = (("left", "right"), ("front", "back"), ("bottom", "top"))
    sides = sides if dimension == 3 else (sides[0], sides[2])

    numbers = lambda corners: [index(at) for at in corners]
    cells, facets = [], {f"{name}_{side}": [] for pair in sides for side in pair}
    for first in np.ndindex(*(count - 1 for count in counts)):
        for axes in permutations(range(dimension)):
            corners = [first]
            for axis in axes:
                corners.append(tuple(i + (a == axis) for a, i in enumerate(corners[-1])))
            for axis in range(dimension):
                for end, side in zip((0, counts[axis] - 1), sides[axis]):
                    on = [at for at in corners if at[axis] == end]
                    if len(on) == dimension:
                        facets[f"{name}_{side}"].append(numbers(on))
            edges = [np.subtract(nodes[index(at)], nodes[index(corners[0])]) for at in corners[1:]]
            cells.append(numbers(corners if np.linalg.det(edges) > 0 else [*corners[:-2], corners[-1], corners[-2]]))
    return {"nodes": nodes, "cells": cells, "facets": facets}


def write_mesh(path, grids):
    """The bodies as one file of Gmsh's format 2.2, whose nodes at the same place in two bodies are two. Returns the numbers of the
    groups by name."""
    dimension = len(grids["lower"]["nodes"][0])
    groups, nodes, elements = {}, [], []
    for name, one in grids.items():
        for group, parts in [*one["facets"].items(), (name, one["cells"])]:
            groups[group] = len(groups) + 1
            kind = {2: 1, 3: 2, 4: 4}[len(parts[0])]
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
    """Runs the text of a job in `folder`. Returns the output folder, the summary and the processor seconds of the whole process."""
    path = folder / "job.toml"
    path.write_text(job + '\n[output]\nfolder = "out"\nalso = ["contact_pressure"]\n')
    spent = lambda: sum(resource.getrusage(resource.RUSAGE_CHILDREN)[:2])
    start = spent()
    done = subprocess.run([SOLVER, "run", path, "--force"], capture_output=True, text=True, timeout=1800)
    seconds = spent() - start
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
        start = time.process_time()
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
        self.seconds = time.process_time() - start
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

    def multiplier(self, components=1, start=0.0):
        """The multiplier: the contact pressure, or the traction of the lower body on the upper one. It has the order of the displacement
        in the plane and is linear in space."""
        self.pressures = gf.MeshFem(self.meshes["upper"], components)
        self.pressures.set_classical_fem(self.order if self.dimension == 2 else 1)
        self.model.add_filtered_fem_variable("p", self.pressures, self.groups["upper_bottom"])
        if start:
            self.model.set_variable("p", np.full_like(self.model.variable("p"), start))

    def rule(self, parts=1):
        """An integration rule for the contact, on this number of parts of an edge."""
        name = "IM_TRIANGLE(6)" if self.dimension == 2 else "IM_TETRAHEDRON(6)"
        method = f"IM_STRUCTURED_COMPOSITE({name},{parts})" if parts > 1 else name
        self.contact_rule = gf.MeshIm(self.meshes["upper"], gf.Integ(method))
        return self.contact_rule

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
        """The point of the lower body below a point of the upper one: the interface of the undeformed lower body is flat, at 0."""
        self.model.add_interpolate_transformation_from_expression("across", self.meshes["upper"], self.meshes["lower"], "[X(1);0]")

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

    def friction(self, r, gap, coefficient, parts):
        """Coulomb friction; the slip is that since the data `w`, the jump of displacement at the last step."""
        self.across()
        self.multiplier(components=self.dimension)
        self.sign = 1.0
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
        """Newton's method, as GetFEM's own examples of contact call it. Adds iterations and processor seconds."""
        start = time.process_time()
        iterations, converged = self.model.solve(
            "max_res", 1e-9, "max_iter", 100, "lsolver", "mumps", "lsearch", "simplest", "alpha min", 0.8
        )
        self.seconds += time.process_time() - start
        self.iterations += int(iterations)
        if not converged:
            raise RuntimeError(f"GetFEM's Newton's method has not converged in {iterations} iterations")

    def profile(self):
        """Places and values of the multiplier at its nodes on the boundary."""
        numbers = self.pressures.basic_dof_on_region(self.groups["upper_bottom"])
        components = self.pressures.qdim()
        places = self.pressures.basic_dof_nodes()[:, numbers[::components]]
        return places.T, self.sign * self.model.variable("p").reshape(-1, components)

    def force(self, component=None):
        """The integral of the contact pressure, or of a component of the traction."""
        part = "p" if component is None else f"p({component + 1})"
        return self.sign * gf.asm_generic(self.contact_rule, 0, part, self.groups["upper_bottom"], self.model)

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
    """The largest difference of displacements at the nodes of both programs, which are at the same places."""
    (places, values), (others, other_values) = ours, peer
    distances, numbers = cKDTree(others).query(places)
    if len(places) != len(others) or distances.max() > 1e-9:
        sys.exit(f"the nodes of the two programs differ: {len(places)}, {len(others)}, by up to {distances.max()} m")
    return np.abs(values - other_values[numbers]).max()


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


PROFILE = '\n[[output.profile]]\non = "upper_bottom"\n'


def time_of(end, step):
    return f'\n[time]\nscheme = "implicit_euler"\nend = {end}\nstep = {step}\n'


def patch(slope, order, cells):
    """Errors of the stress and of the contact pressure of two blocks under a uniform pressure from all sides: of the solver, and of GetFEM
    with its rule on whole facets and on parts of them."""
    modulus, nu, pressure, dimension = 2e6, 0.3, 1e5, len(cells[0])
    interface = lambda x: 1 + slope * (x - 0.5)

    def lower(*at):
        return (*at[:-1], at[-1] * interface(at[0]))

    def upper(*at):
        return (*at[:-1], 2 - (1 - at[-1]) * (2 - interface(at[0])))

    moduli = dict.fromkeys(BODIES, modulus)
    held, pressed = (["left"], ["right"]) if dimension == 2 else (["left", "front"], ["right", "back"])
    fixed = [(f"{name}_{side}", axis) for name in BODIES for axis, side in enumerate(held)]
    fixed.append(("lower_bottom", dimension - 1))
    loads = [(f"{name}_{side}", axis) for name in BODIES for axis, side in enumerate(pressed)]
    loads.append(("upper_top", dimension - 1))
    loads = [(group, [-pressure * (a == axis) for a in range(dimension)]) for group, axis in loads]
    with tempfile.TemporaryDirectory() as folder:
        mesh = Path(folder) / "bodies.msh"
        shares = [[graded(n) for n in counts] for counts in cells]
        grids = {name: grid(name, *one) for name, one in zip(BODIES, zip(shares, (lower, upper)))}
        groups = write_mesh(mesh, grids)
        job = head(order, moduli, nu, dimension) + time_of(1.0, 1.0)
        job += "".join(support(*one) for one in fixed) + "".join(traction(*one) for one in loads)
        out, *_ = run_solver(Path(folder), job + PROFILE)
        stresses = Fields(out, dimension).stresses
        # In plane strain the third normal stress is another one.
        errors = [np.abs(stresses[:, :dimension] + pressure).max(), np.abs(stresses[:, 3:]).max()]
        pressures = [float(row["contact_pressure"]) for row in rows(out / "profiles.csv")]
        results = [max(errors) / pressure, max(abs(one / pressure - 1) for one in pressures)]
        for parts in (1, 8 if dimension == 2 else 2):
            peer = Peer(mesh, groups, order, moduli, nu)
            for one in fixed:
                peer.fix(*one)
            for one in loads:
                peer.load(*one)
            peer.brick(modulus, parts)
            peer.solve()
            results.append(np.abs(peer.stresses() + pressure * np.eye(dimension)).max() / pressure)
            results.append(np.abs(peer.profile()[1] / pressure - 1).max())
        return results


def patches():
    flat, blocks = ((5, 4), (7, 5)), ((3, 3, 2), (4, 5, 2))
    cases = [
        ("flat, linear", 0.0, 1, flat),
        ("flat, quadratic", 0.0, 2, flat),
        ("inclined, linear", 0.4, 1, flat),
        ("inclined, quadratic", 0.4, 2, flat),
        ("3D, linear", 0.0, 1, blocks),
        ("3D, quadratic", 0.0, 2, blocks),
        ("3D, inclined, linear", 0.4, 1, blocks),
    ]
    table = ["", "Clarke: stress", "pressure", "GetFEM: stress", "pressure", "GetFEM, facets in parts: stress", "pressure"]
    return [table] + [[name, *(f"{error:.1e}" for error in patch(*case))] for name, *case in cases]


class Hertz:
    """Blocks with the gap of cylinders between them, and what both programs are measured by."""

    RADIUS, NU, HALF_WIDTH = 1.2, 0.3, 0.05

    def __init__(self, moduli):
        self.moduli = moduli
        # GetFEM's manual: near Young's modulus. In integrals over a boundary it is one per length.
        self.augmentation = min(moduli.values()) / self.HALF_WIDTH
        self.modulus = 1 / ((1 - self.NU**2) * sum(1 / one for one in moduli.values()))

    def line(self, force):
        """Half width and largest pressure of cylinders under a force per length."""
        a = sqrt(4 * force * self.RADIUS / (pi * self.modulus))
        return a, 2 * force / (pi * a)


def measures(x, pressures, a, largest):
    """Errors of the largest pressure, of the half width that follows from the second moment of the pressure, and of the pressure
    itself, the mean square within 1.5 a relative to the largest."""
    order = np.argsort(x)
    fine = np.linspace(-1.5 * a if x.min() < 0 else 0.0, 1.5 * a, 3001)
    values = np.interp(fine, x[order], pressures[order])
    width = 2 * sqrt(np.sum(values * fine**2) / np.sum(values))
    exact = largest * np.sqrt(np.maximum(1 - (fine / a) ** 2, 0))
    return [pressures.max() / largest - 1, width / a - 1, sqrt(np.mean((values - exact) ** 2)) / largest]


def numbers(out, *columns):
    """Columns of the last output of the profile."""
    found = rows(out / "profiles.csv")
    return [np.array([float(row[name]) for row in found]) for name in columns]


def resultant(out, source, component):
    [*_, last] = [row for row in rows(out / "resultants.csv") if row["source"] == source]
    return float(last[component])


def difference(fields, peer):
    """The largest difference of displacements between the programs, at all nodes, relative to the largest displacement."""
    sides = {"lower": lambda centre: centre[-1] < 0, "upper": lambda centre: centre[-1] > 0}
    largest = max(largest_difference(fields.of_body(side), peer.displacements(name)) for name, side in sides.items())
    return largest / np.abs(fields.displacements).max()


def fastest(run, again=2):
    """The result of the faster one of two runs that give themselves and their seconds; long ones run once."""
    results = [run()]
    while len(results) < again and results[0][-1] < 10:
        results.append(run())
    return min(results, key=lambda result: result[-1])


HERTZ_HEAD = ["cells", "program", "largest pressure", "half width", "pressure, mean square", "force", "Newton", "seconds", "displacements"]


def line_of_hertz(name, program, errors, counts, apart=None):
    texts = [f"{one:+.1e}" for one in errors[:2]] + [f"{one:.1e}" for one in np.abs(errors[2:])]
    return [name, program, *texts, str(counts[0]), f"{counts[1]:.1f}", "" if apart is None else f"{apart:.1e}"]


def cylinders():
    """Half of two cylinders of different moduli under a given force."""
    hertz = Hertz({"lower": 3e9, "upper": 1e9})
    force = pi * hertz.modulus * hertz.HALF_WIDTH**2 / (4 * hertz.RADIUS)
    a, largest = hertz.line(force)
    table = [HERTZ_HEAD]
    for columns, rows_ in ((24, 12), (48, 24), (96, 48)):
        grids = {
            "lower": grid("lower", [graded(columns, 2), toward_end(graded(rows_, 2))], lambda u, v: (2 * u, 2 * v - 2)),
            "upper": grid("upper", [graded(columns * 9 // 8, 2), graded(rows_, 2)], lambda u, v: (2 * u, 2 * v)),
        }
        name = f"{columns} and {columns * 9 // 8} x {rows_}"
        with tempfile.TemporaryDirectory() as folder:
            mesh = Path(folder) / "bodies.msh"
            groups = write_mesh(mesh, grids)
            held = [("lower_left", 0), ("upper_left", 0), ("lower_bottom", 1)]
            load = ("upper_top", [0.0, -force / 4])
            job = head(2, hertz.moduli, hertz.NU, gap=f'gap = "x^2/{2 * hertz.RADIUS}"') + time_of(1.0, 1.0)
            job += "".join(support(*one) for one in held) + traction(*load) + PROFILE
            out, summary, seconds = fastest(lambda: run_solver(Path(folder), job))
            x, pressures = numbers(out, "x", "contact_pressure")
            reached = resultant(out, "contact upper_bottom", "force_y")
            errors = [*measures(x, pressures, a, largest), reached / (force / 2) - 1]
            table.append(line_of_hertz(name, "Clarke", errors, (summary["newton_iterations"], seconds)))
            for parts, program in ((1, "GetFEM"), (4, "GetFEM, facets in 4 parts")):

                def solved():
                    peer = Peer(mesh, groups, 2, hertz.moduli, hertz.NU)
                    for one in held:
                        peer.fix(*one)
                    peer.load(*load)
                    # From no pressure the upper body would hang on nothing.
                    peer.contact(hertz.augmentation, f"sqr(X(1))/{2 * hertz.RADIUS}", largest, parts)
                    peer.solve()
                    return peer, peer.seconds

                peer, _ = fastest(solved)
                places, pressures = peer.profile()
                errors = [*measures(places[:, 0], pressures[:, 0], a, largest), peer.force() / (force / 2) - 1]
                apart = difference(Fields(out, 2), peer)
                table.append(line_of_hertz("", program, errors, (peer.iterations, peer.seconds), apart))
    return table


def friction():
    """Two equal cylinders, pressed on each other and then moved along each other by less than their friction allows to slide."""
    hertz, coefficient, down, along = Hertz({"lower": 1.5e9, "upper": 1.5e9}), 0.3, 0.004, 0.0012
    table = [["cells", "program", "largest pressure", "friction, mean square", "half of the sticking width", "P", "Q", "Newton", "seconds", "displacements"]]

    def line(name, program, profile, forces, counts, apart=None):
        x, pressures, tractions = (one[np.argsort(profile[0])] for one in profile)
        a, largest = hertz.line(forces[1])
        c = a * sqrt(1 - abs(forces[0]) / (coefficient * forces[1]))
        fine = np.linspace(-1.5 * a, 1.5 * a, 6001)
        exact = np.sqrt(np.maximum(1 - (fine / a) ** 2, 0)) - c / a * np.sqrt(np.maximum(1 - (fine / c) ** 2, 0))
        values = np.abs(np.interp(fine, x, tractions)) / (coefficient * largest)
        # What the friction falls short of its bound by has the second moment c^2/4.
        missing = np.interp(fine, x, coefficient * pressures - np.abs(tractions))
        sticking = 2 * sqrt(np.sum(missing * fine**2) / np.sum(missing))
        errors = [f"{pressures.max() / largest - 1:+.1e}", f"{sqrt(np.mean((values - exact) ** 2)):.1e}", f"{sticking / c - 1:+.1e}"]
        shown = [f"{forces[1]:.6g}", f"{abs(forces[0]):.6g}", str(counts[0]), f"{counts[1]:.1f}"]
        table.append([name, program, *errors, *shown, "" if apart is None else f"{apart:.1e}"])

    for columns, rows_ in ((48, 12), (96, 24)):
        fine = columns * 9 // 8
        grids = {
            "lower": grid("lower", [both_ways(columns, 2), toward_end(graded(rows_, 2))], lambda u, v: (4 * u - 2, 2 * v - 2)),
            "upper": grid("upper", [both_ways(fine, 2), graded(rows_, 2)], lambda u, v: (4 * u - 2, 2 * v)),
        }
        name = f"{columns} and {fine} x {rows_}"
        with tempfile.TemporaryDirectory() as folder:
            mesh = Path(folder) / "bodies.msh"
            groups = write_mesh(mesh, grids)
            more = f"friction.coulomb.coefficient = {coefficient}"
            job = head(2, hertz.moduli, hertz.NU, gap=f'gap = "x^2/{2 * hertz.RADIUS}"', more=more) + time_of(2.0, 1.0)
            job += support("lower_bottom", 0) + support("lower_bottom", 1)
            job += support("upper_top", 0, f"{along}*max(t - 1, 0)") + support("upper_top", 1, f"-{down}*min(t, 1)") + PROFILE
            out, summary, seconds = fastest(lambda: run_solver(Path(folder), job))
            profile = numbers(out, "x", "contact_pressure", "friction_traction_x")
            forces = [resultant(out, "contact upper_bottom", f"force_{axis}") for axis in "xy"]
            line(name, "Clarke", profile, forces, (summary["newton_iterations"], seconds))

            def solved():
                peer = Peer(mesh, groups, 2, hertz.moduli, hertz.NU)
                peer.data("along", 0.0)
                for one in (("lower_bottom", 0), ("lower_bottom", 1), ("upper_top", 0, "along"), ("upper_top", 1, f"-{down}")):
                    peer.fix(*one)
                peer.friction(hertz.augmentation, f"sqr(X(1))/{2 * hertz.RADIUS}", coefficient, 4)
                peer.solve()
                for body in BODIES:
                    peer.model.set_variable("before_" + body, peer.model.variable("u_" + body))
                peer.model.set_variable("along", along)
                peer.solve()
                return peer, peer.seconds

            peer, _ = fastest(solved)
            places, tractions = peer.profile()
            profile = (places[:, 0], tractions[:, 1], tractions[:, 0])
            apart = difference(Fields(out, 2), peer)
            line("", "GetFEM, facets in 4 parts", profile, [peer.force(0), peer.force(1)], (peer.iterations, peer.seconds), apart)
    return table


# Tables


def markdown(table):
    first, *others = table
    rule = "|---|" + "".join("---|" if cell == "program" else "--:|" for cell in first[1:])
    rows = ["| " + " | ".join(line) + " |" for line in [first, *others]]
    return "\n".join([rows[0], rule, *rows[1:]])


def machine():
    """Processor, its cores and the width of its vectors, as in the other tables."""
    facts = [line.partition(":")[::2] for line in Path("/proc/cpuinfo").read_text().splitlines()]
    values = lambda key: [value.strip() for name, value in facts if name.strip() == key]
    flags = values("flags")[0].split() if values("flags") else []
    bits = 512 if "avx512vl" in flags else 256 if "avx2" in flags else 128
    model = (values("model name") or ["an unknown processor"])[0]
    return f"{len(values('processor'))} cores of {model} with {bits}-bit vectors"


def write_table(name, text):
    page = PAGE.read_text()
    begin, end = f"<!-- table {name} -->\n", f"<!-- end of table {name} -->"
    before, rest = page.split(begin)
    _, after = rest.split(end)
    today = datetime.datetime.now(datetime.timezone.utc).date()
    PAGE.write_text(f"{before}{begin}`scripts/compare_getfem.py --write` on {machine()}, {today}:\n\n{text}\n\n{end}{after}")


def main(arguments):
    cases = {"patch": patches, "cylinders": cylinders, "friction": friction}
    chosen = [one for one in arguments if one != "--write"] or list(cases)
    if not set(chosen) <= set(cases):
        sys.exit(__doc__)
    if not SOLVER.exists():
        sys.exit(f"{SOLVER} is not there: make build, or SOLVER=PATH")
    gf.util_trace_level(0)
    gf.util_warning_level(0)
    for name in chosen:
        text = markdown(cases[name]())
        print(text, flush=True)
        if "--write" in arguments:
            write_table(name, text)


if __name__ == "__main__":
    main(sys.argv[1:])

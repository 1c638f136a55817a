"""Draws the pictures of this folder from what a run of jobs/papers/wang_cheng_2022.toml left.

    make run
    python3 -m venv pictures && pictures/bin/pip install \
        matplotlib==3.11.2 meshio==5.3.5 h5py==3.16.0 numpy==2.4.6
    pictures/bin/python docs/pictures/draw.py jobs/papers/out/wang_cheng_2022

Reads fields.xdmf (with fields.vtkhdf), profiles.csv and probes.csv; writes PNG files beside itself. A tool for
developers: the solver does not need it.
"""

import csv
import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import meshio
import numpy as np

# r_1 and r_2 of the job's damped response, m/s: between them the contact pressure falls.
BREAKPOINTS = (0.003, 0.005)
STATES = ("S4", "S5", "S6")
STATE_COLOURS = ("#dbe9f6", "#fdebd0", "#e3e3e3")
# The three colours stay apart for all common kinds of colour blindness (Okabe and Ito).
BLUE, ORANGE, GREEN = "#0072b2", "#d55e00", "#009e73"
MAGNIFY = 4
WIDTH = 8.0

plt.rcParams.update({"font.size": 11, "axes.titlesize": 11, "figure.dpi": 100, "savefig.dpi": 100})


class Run:
    """The output of a run: mesh and fields at the end, the last profile, the probes' histories."""

    def __init__(self, folder):
        with meshio.xdmf.TimeSeriesReader(folder / "fields.xdmf") as reader:
            points, cells = reader.read_points_cells()
            self.time, nodal, cellwise = reader.read_data(reader.num_steps - 1)
        self.points = points[:, :2]
        self.triangles = cells[0].data
        self.displacement = nodal["displacement"][:, :2]
        self.von_mises = cellwise["von_mises"][0]
        rows = [row for row in csv.DictReader(open(folder / "profiles.csv")) if row["profile"] == "bottom"]
        last = max(float(row["time"]) for row in rows)
        self.profile = columns([row for row in rows if float(row["time"]) == last], skip={"profile"})
        probes = list(csv.DictReader(open(folder / "probes.csv")))
        names = dict.fromkeys(row["probe"] for row in probes)
        self.probes = {n: columns([r for r in probes if r["probe"] == n], skip={"probe"}) for n in names}

    def deformed(self):
        """Positions of the nodes, displacement magnified."""
        return self.points + MAGNIFY * self.displacement


def columns(rows, skip):
    return {key: np.array([float(row[key]) for row in rows]) for key in rows[0] if key not in skip}


def state_borders(profile):
    """Positions at which the normal velocity passes the breakpoints, by linear interpolation."""
    return [float(np.interp(r, profile["normal_velocity"], profile["x"])) for r in BREAKPOINTS]


def mark_states(axes, profile, names=False):
    """Shades the parts of the boundary in each state of the law."""
    edges = [0.0, *state_borders(profile), 1.0]
    for name, colour, low, high in zip(STATES, STATE_COLOURS, edges, edges[1:]):
        axes.axvspan(low, high, color=colour, zorder=0, lw=0)
        if names:
            axes.annotate(name, ((low + high) / 2, 1.02), xycoords=("data", "axes fraction"), ha="center")
    axes.set_xlim(0, 1)


def draw_mesh(axes, run, points, edges):
    image = axes.tripcolor(*points.T, run.triangles, facecolors=run.von_mises, cmap="viridis", shading="flat")
    if edges:
        axes.triplot(*points.T, run.triangles, color="0.85", lw=0.2)
    axes.set_aspect("equal")
    axes.set_xlabel("x / m")
    axes.set_ylabel("y / m")
    return image


def curve(axes, profile, key, label, colour, scale=1.0):
    axes.plot(profile["x"], scale * profile[key], color=colour, marker="o", ms=3, lw=1.5)
    axes.set_ylabel(label)
    axes.grid(alpha=0.4)


def overview(run):
    """The picture of the README: deformed mesh and contact boundary."""
    figure = plt.figure(figsize=(WIDTH, 3.7), layout="constrained")
    grid = figure.add_gridspec(2, 2, width_ratios=(1.3, 1))
    axes = figure.add_subplot(grid[:, 0])
    image = draw_mesh(axes, run, run.deformed(), edges=True)
    axes.plot([0, 1, 1, 0, 0], [0, 0, 1, 1, 0], color="0.4", lw=0.8, ls="--")
    axes.set_title(f"t = {run.time:g} s, displacement × {MAGNIFY}")
    figure.colorbar(image, ax=axes, label="von Mises stress / Pa", shrink=0.9)
    upper = figure.add_subplot(grid[0, 1])
    lower = figure.add_subplot(grid[1, 1], sharex=upper)
    curve(upper, run.profile, "normal_velocity", "normal velocity\n/ (mm/s)", BLUE, 1e3)
    for r in BREAKPOINTS:
        upper.axhline(1e3 * r, color="0.3", lw=0.8, ls=":")
    curve(lower, run.profile, "contact_pressure", "contact pressure\n/ Pa", ORANGE)
    mark_states(upper, run.profile, names=True)
    mark_states(lower, run.profile)
    upper.tick_params(labelbottom=False)
    lower.set_xlabel("x along the contact boundary / m")
    return figure


def contact_arrows(run):
    """Figure 3 of the paper: deformed mesh with contact velocity and with interface forces."""
    figure, pair = plt.subplots(1, 2, figsize=(WIDTH, 4.6), layout="constrained", sharey=True)
    bottom = np.flatnonzero(run.points[:, 1] == 0)
    foot = run.deformed()[bottom[np.argsort(run.points[bottom, 0])]]
    largest = {key: run.profile[key].max() for key in ("normal_velocity", "contact_pressure")}
    for axes, key, colour, up, words in (
        (pair[0], "normal_velocity", BLUE, False, "contact velocity, up to {:.4f} m/s"),
        (pair[1], "contact_pressure", ORANGE, True, "interface force, up to {:.4f} Pa"),
    ):
        axes.triplot(*run.deformed().T, run.triangles, color="0.55", lw=0.35)
        length = 0.3 * run.profile[key] / largest[key]
        axes.quiver(
            foot[:, 0], foot[:, 1] - up * length, 0 * length, length if up else -length,
            color=colour, angles="xy", scale_units="xy", scale=1, width=0.005, zorder=3,
        )  # fmt: skip
        axes.set_title(words.format(largest[key]))
        axes.set_aspect("equal")
        axes.set_xlim(-0.1, 1.08)
        axes.set_ylim(-0.52, 1.02)
        axes.set_xlabel("x / m")
    pair[0].set_ylabel("y / m")
    figure.suptitle(f"t = {run.time:g} s, displacement × {MAGNIFY}", fontsize=11)
    return figure


def boundary(run):
    """Figure 4 of the paper: normal velocity, interface forces and normal displacement."""
    figure, stack = plt.subplots(3, 1, figsize=(WIDTH, 6.6), layout="constrained", sharex=True)
    curve(stack[0], run.profile, "normal_velocity", "normal velocity\n/ (mm/s)", BLUE, 1e3)
    for r, name in zip(BREAKPOINTS, ("$r_1$", "$r_2$")):
        stack[0].axhline(1e3 * r, color="0.3", lw=0.8, ls=":")
        stack[0].annotate(name, (0.01, 1e3 * r), va="bottom")
    curve(stack[1], run.profile, "contact_pressure", "contact pressure\n/ Pa", ORANGE)
    curve(stack[2], run.profile, "normal_displacement", "normal displacement\n/ mm", GREEN, 1e3)
    for axes in stack:
        mark_states(axes, run.profile, names=axes is stack[0])
    stack[2].set_xlabel("x along the contact boundary / m")
    return figure


def stress(run):
    """Figure 5 of the paper: the von Mises norm."""
    figure, axes = plt.subplots(figsize=(WIDTH * 0.75, 5.0), layout="constrained")
    image = draw_mesh(axes, run, run.points, edges=False)
    figure.colorbar(image, ax=axes, label="von Mises stress / Pa")
    axes.set_title(f"t = {run.time:g} s; largest {run.von_mises.max():.1f} Pa")
    return figure


def evolution(run):
    """Figure 6 of the paper: normal velocity and displacement at three points of the boundary."""
    figure, pair = plt.subplots(1, 2, figsize=(WIDTH, 3.9), layout="constrained")
    looks = ((GREEN, ":", "x = h = 1/32 m"), (ORANGE, "--", "x = 0.5 m"), (BLUE, "-", "x = 1 m"))
    for (colour, style, label), probe in zip(looks, ("near_corner", "middle", "tip")):
        values = run.probes[probe]
        for axes, key in zip(pair, ("velocity_y", "displacement_y")):
            time, value = np.append(0, values["time"]), np.append(0, -1e3 * values[key])
            axes.plot(time, value, color=colour, ls=style, lw=2, label=label)
    for axes, label in zip(pair, ("normal velocity / (mm/s)", "normal displacement / mm")):
        axes.set_xlabel("t / s")
        axes.set_ylabel(label)
        axes.set_xlim(0, run.time)
        axes.grid(alpha=0.4)
    pair[0].legend()
    return figure


def main():
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    run = Run(Path(sys.argv[1]))
    pictures = {
        "wang_cheng_2022": overview,
        "contact_arrows": contact_arrows,
        "boundary": boundary,
        "von_mises": stress,
        "evolution": evolution,
    }
    for name, draw in pictures.items():
        draw(run).savefig(Path(__file__).parent / f"{name}.png")
    print("velocity passes r_1, r_2 at x =", *(f"{x:.3f}" for x in state_borders(run.profile)), "m")


if __name__ == "__main__":
    main()

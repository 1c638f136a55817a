"""A first run: a block slides on a plane until friction stops it, and where its energy goes.

    python3 first_run.py [FOLDER]        writes FOLDER/first_run.png
"""

import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

import clarke

JOB = {
    "mesh": {"rectangle": {"size": [0.4, 0.1], "cells": [16, 4]}},  # m
    "material": {
        "hypothesis": "plane_strain",
        "density": 1000.0,  # kg/m^3
        "viscosity": {"volumetric": 1e6, "shear": 1e6},  # Pa s
    },
    "initial": {"velocity": [1.0, 0.0]},  # m/s
    "body_force": [{"value": [0.0, -9810.0]}],  # N/m^3
    "contact": [{"on": ["bottom"], "normal": {"unilateral": {}}, "friction": {"coulomb": {"coefficient": 0.5}}}],
    "time": {"end": 0.25, "step": 0.001},  # s
    "output": {"probe": [{"name": "centre", "point": [0.2, 0.05]}]},
}


def main(folder: Path) -> None:
    run = clarke.run(JOB, ranks=2, folder=folder / "first_run", force=True)
    history = run.history
    unit = history.attrs["units"]["kinetic_energy"]

    figure, axes = plt.subplots(figsize=(7, 4), layout="constrained")
    axes.plot(history["time"], history["kinetic_energy"], label="kinetic energy")
    axes.plot(history["time"], history["contact_dissipation"], label="dissipated by friction")
    axes.plot(history["time"], history["kinetic_energy"] + history["contact_dissipation"], "k:", label="sum")
    axes.axvline(1.0 / (0.5 * 9.81), color="grey", linewidth=0.8, label="v / (µ g)")
    axes.set(xlabel="time [s]", ylabel=f"energy [{unit}]", title="A block slides to a stop")
    axes.legend()
    figure.savefig(folder / "first_run.png", dpi=120)

    way = run.columns("probes", of="centre")["displacement_x"][-1]
    print(f"the block has moved {way:.5f} m; v^2 / (2 µ g) = {1 / (2 * 0.5 * 9.81):.5f} m")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "out"))

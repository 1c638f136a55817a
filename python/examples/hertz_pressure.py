"""Contact pressure of an elastic block on a rigid cylinder (jobs/verification/hertz_line.toml) and the closed form of Hertz.

    python3 hertz_pressure.py [FOLDER]        writes FOLDER/hertz_pressure.png
"""

import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy

import clarke

JOB = Path(__file__).resolve().parents[2] / "jobs/verification/hertz_line.toml"
HALF_WIDTH = 0.05  # m
LARGEST = 27.472527e6  # Pa


def main(folder: Path) -> None:
    job = clarke.load(JOB)
    job["output"] = {"profile": [{"on": "bottom"}]}
    figure, axes = plt.subplots(figsize=(7, 4.5), layout="constrained")
    x = numpy.linspace(0, HALF_WIDTH, 400)
    axes.plot(x, LARGEST * numpy.sqrt(1 - (x / HALF_WIDTH) ** 2) / 1e6, "k", label="Hertz")
    for cells, marker in ((16, "x"), (64, ".")):
        run = clarke.run(job, folder=folder / f"hertz_{cells}", set={"mesh.rectangle.cells": [cells, cells]}, force=True)
        profiles = run.profiles
        end = profiles[profiles["time"] == profiles["time"].max()]
        axes.plot(end["x"], end["contact_pressure"] / 1e6, marker, label=f"{cells} × {cells} cells")
        largest = end["contact_pressure"].max()
        print(f"{cells} x {cells} cells: largest pressure {largest / 1e6:.3f} MPa, Hertz {LARGEST / 1e6:.3f} MPa")
    axes.set(xlim=(0, 1.5 * HALF_WIDTH), xlabel="x [m]", ylabel="contact pressure [MPa]", title="A block on a cylinder")
    axes.legend()
    figure.savefig(folder / "hertz_pressure.png", dpi=120)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "out"))

"""A sweep: how far a block slides (jobs/sliding_block.toml), over its speed and the coefficient of friction.

    python3 speed_sweep.py [FOLDER]        writes FOLDER/speed_sweep.png
"""

import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy

import clarke

JOB = Path(__file__).resolve().parents[2] / "jobs/sliding_block.toml"
SPEED = "initial.velocity.0"
COEFFICIENT = "contact.0.friction.coulomb.coefficient"
WAY = "probe.centre.displacement_x"


def main(folder: Path) -> None:
    sweep = clarke.sweep(
        JOB,
        {SPEED: [0.2, 0.4, 0.6, 0.8, 1.0], COEFFICIENT: [0.2, 0.3, 0.4, 0.5, 0.6]},
        [WAY],
        folder=folder / "speed_sweep",
        ranks=2,
        set={"time.end": 0.55, "time.step": 0.0025},
    )
    frame = sweep.frame
    ways = frame.pivot(index=COEFFICIENT, columns=SPEED, values=WAY)

    figure, axes = plt.subplots(figsize=(7, 4.5), layout="constrained")
    picture = axes.pcolormesh(ways.columns, ways.index, ways, shading="nearest")
    figure.colorbar(picture, label=f"way [{frame.attrs['units'][WAY]}]")
    speed, coefficient = numpy.meshgrid(numpy.linspace(0.1, 1.1), numpy.linspace(0.15, 0.65))
    lines = axes.contour(speed, coefficient, speed**2 / (2 * 9.81 * coefficient), colors="white", linewidths=0.9)
    axes.clabel(lines)
    axes.set(xlabel="speed [m/s]", ylabel="coefficient of friction", title="Way of a block; lines: v² / (2 µ g)")
    figure.savefig(folder / "speed_sweep.png", dpi=120)

    closed = frame[SPEED] ** 2 / (2 * 9.81 * frame[COEFFICIENT])
    print(f"{len(frame)} runs, at most {abs(frame[WAY] - closed).max():.5f} m from v^2 / (2 µ g); steps of 2.5 ms add up to v k / 2")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "out"))

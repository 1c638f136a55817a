"""Friction force on a brake pad over time, dragged along a deformable rail under a pulsing pressure (jobs/brake_pad.toml).

    python3 brake_friction.py [FOLDER]        writes FOLDER/brake_friction.png
"""

import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy

import clarke

JOB = Path(__file__).resolve().parents[2] / "jobs/brake_pad.toml"


PRESSURE = "20*(1 - 0.5*cos(2*pi*t/0.4))"  # Pa, on 0.5 m


def main(folder: Path) -> None:
    run = clarke.run(JOB, folder=folder / "brake_friction", set={"traction.0.value": [0.0, f"-{PRESSURE}"]}, force=True)
    contacts = run.contacts
    pad = contacts[contacts["source"] == "contact pad.bottom"]
    units = contacts.attrs["units"]
    bound = 0.3 * 0.5 * 20 * (1 - 0.5 * numpy.cos(2 * numpy.pi * pad["time"] / 0.4))

    figure, (above, below) = plt.subplots(2, sharex=True, figsize=(7, 5), layout="constrained")
    above.plot(pad["time"], -pad["force_x"], label="friction force")
    above.plot(pad["time"], bound, "k:", label="0.3 × load")
    above.set(ylabel=f"force [{units['force_x']}]", title="Brake pad on a deformable rail", ylim=(0, None))
    above.legend()
    below.plot(pad["time"], pad["largest_pressure"], label="largest")
    below.plot(pad["time"], pad["mean_pressure"], label="mean")
    below.set(xlabel="time [s]", ylabel=f"contact pressure [{units['mean_pressure']}]", ylim=(0, None))
    below.legend()
    figure.savefig(folder / "brake_friction.png", dpi=120)

    off = abs(-pad["force_x"] - bound).max()
    print(f"friction force up to {-pad['force_x'].min():.4f} {units['force_x']}, at most {off:.1g} from 0.3 of the load")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "out"))

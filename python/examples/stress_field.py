"""Von Mises stress of a block on which a letter is stamped (jobs/stamped_block.toml), drawn off screen.

    python3 stress_field.py [FOLDER]        writes FOLDER/stress_field.png
"""

import sys
from pathlib import Path

import pyvista

import clarke

JOB = Path(__file__).resolve().parents[2] / "jobs/stamped_block.toml"


def main(folder: Path) -> None:
    run = clarke.run(JOB, folder=folder / "stress_field", force=True)
    grid = run.fields()
    unit = grid.user_dict["units"]["von_mises"]
    deformed = grid.warp_by_vector("displacement")

    plotter = pyvista.Plotter(off_screen=True, window_size=[900, 700])
    plotter.add_mesh(deformed, scalars="von_mises", show_edges=True, line_width=0.3, show_scalar_bar=False)
    plotter.add_scalar_bar(f"von Mises stress [{unit}]", vertical=True, position_x=0.85, position_y=0.3, fmt="%.1e")
    plotter.add_text(f"t = {grid.user_dict['time']:g} s", font_size=12)
    plotter.camera_position = "iso"
    plotter.screenshot(folder / "stress_field.png")

    print(f"largest {grid['von_mises'].max():.6g} {unit}, in the summary {run.quantity('final_von_mises'):.6g}")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "out"))

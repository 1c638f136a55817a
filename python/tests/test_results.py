"""Reading output folders."""

import json
import math
import os
import shutil
import signal
import subprocess
import unittest
from pathlib import Path

import clarke
from clarke import declared, program, tables

from . import sample
from .test_program import _wait_for


def copied() -> Path:
    """A copy of the folder of the finished run, which a test may damage."""
    return Path(shutil.copytree(sample.finished().folder, sample.folder() / "out"))


class Tables(unittest.TestCase):
    def test_history_has_the_energies_of_the_problem(self) -> None:
        history = sample.finished().columns("history")
        self.assertEqual(history["step"], list(range(1, 251)))
        self.assertAlmostEqual(history["time"][-1], 0.25)
        # 40 kg/m at 1 m/s: 20 J/m, which friction dissipates but for what the scheme does.
        self.assertAlmostEqual(history["contact_dissipation"][-1] + history["numerical_dissipation"][-1], 20.0, delta=0.05)
        self.assertLess(history["kinetic_energy"][-1], 1e-6)

    def test_rows_are_selected_by_their_names(self) -> None:
        run = sample.finished()
        centre = run.columns("probes", of="centre")
        # v0^2 / (2 a) - k v0 / 2 with a = 0.5 * 9.81 m/s^2
        self.assertAlmostEqual(centre["displacement_x"][-1], 0.10144, delta=1e-4)
        self.assertEqual(set(run.columns("probes")["probe"]), {"centre", "first", "foot"})
        contact = run.columns("resultants", of="contact bottom")
        self.assertAlmostEqual(contact["force_y"][-1], 392.4, delta=1e-3)
        profile = run.columns("profiles", of="bottom")
        self.assertEqual(sorted(set(profile["time"])), [0.0, 0.1, 0.2, 0.25])
        self.assertEqual(profile.rows, 4 * 9)

    def test_columns_that_do_not_apply_are_nan(self) -> None:
        of_load = sample.finished().columns("resultants", of="body_force")
        self.assertTrue(all(math.isnan(area) for area in of_load["touching_area"]))

    def test_unknown_names_are_refused_with_the_known_ones(self) -> None:
        run = sample.finished()
        with self.assertRaisesRegex(clarke.Error, "no probe 'tip'; there are centre, first, foot"):
            run.columns("probes", of="tip")
        with self.assertRaisesRegex(clarke.Error, "there are history, resultants, probes and profiles"):
            run.columns("energies")
        with self.assertRaisesRegex(KeyError, "no column energy; there are step, time"):
            run.columns("history")["energy"]
        short = clarke.run(
            sample.sliding_block(output={"fields": {"every": 100}}, check={}),
            folder=sample.folder() / "out",
            set={"time.end": 0.001},
            quiet=True,
        )
        with self.assertRaisesRegex(clarke.NoResults, r"the job has no \[\[output.probe\]\]"):
            short.columns("probes")

    def test_a_row_that_is_not_written_to_its_end_is_left_out(self) -> None:
        folder = copied()
        text = (folder / "history.csv").read_text()
        for cut in (1, 30, len(text.splitlines()[-1])):
            (folder / "history.csv").write_text(text[:-cut])
            self.assertEqual(clarke.open(folder).columns("history").rows, 249, f"cut by {cut}")
        (folder / "history.csv").write_text(text[:10])
        with self.assertRaisesRegex(clarke.NoResults, "has no rows yet"):
            clarke.open(folder).columns("history")

    def test_damaged_rows_are_named(self) -> None:
        folder = copied()
        lines = (folder / "history.csv").read_text().splitlines(keepends=True)
        for damaged, words in [("3,0.003\n", "line 4: 2 entries for 22"), (lines[3].replace(".", "x"), "line 4: time is no number")]:
            (folder / "history.csv").write_text("".join([*lines[:3], damaged, *lines[4:]]))
            with self.assertRaisesRegex(clarke.Damaged, words):
                clarke.open(folder).columns("history")

    def test_apostrophes_for_spreadsheets_are_removed_where_they_are_guards(self) -> None:
        names = [tables.unguarded(name) for name in ("'=a", "''b", "'-c", "'d", "e'")]
        self.assertEqual(names, ["=a", "'b", "-c", "'d", "e'"])

    @sample.needs("pandas")
    def test_frames_have_the_columns_and_units(self) -> None:
        run = sample.finished()
        for word in ("history", "resultants", "probes", "profiles"):
            frame, plain = getattr(run, word), run.columns(word)
            self.assertEqual(list(frame.columns), list(plain))
            self.assertEqual(frame.attrs["units"], plain.units)
            self.assertEqual(len(frame), plain.rows)
        self.assertEqual(set(run.contacts["source"]), {"contact bottom"})
        self.assertEqual(run.contacts.attrs["units"]["mean_pressure"], "Pa")

    def test_a_missing_package_is_named(self) -> None:
        code = "import sys; sys.modules['pandas'] = sys.modules['pyvista'] = sys.modules['h5py'] = None\nimport clarke\n"
        for use, words in [("history", "pip install pandas"), ("fields()", "pip install .*h5py"), ("times", "pip install h5py")]:
            ended = program.start(
                ["env", f"PYTHONPATH={sample.ROOT / 'python'}", shutil.which("python3") or "python3", "-c",
                 f"{code}clarke.open({str(sample.finished().folder)!r}).{use}"],
                show=False,
            )
            self.assertRegex(ended.errors.splitlines()[-1], f"PackageMissing: .*{words}")


class Units(unittest.TestCase):
    def test_every_column_of_a_run_is_declared(self) -> None:
        run = sample.finished()
        for word in ("history", "resultants", "probes", "profiles"):
            missing = set(run.columns(word)) - set(declared.units(f"{word}.csv"))
            self.assertEqual(missing, set())

    def test_units_are_those_of_the_plane_or_of_space(self) -> None:
        run = sample.finished()
        units = run.columns("resultants").units | run.columns("history").units | run.columns("profiles").units
        for name, unit in [
            ("time", "s"), ("step", ""), ("force_x", "N/m"), ("moment_z", "N"), ("touching_area", "m"), ("mean_pressure", "Pa"),
            ("kinetic_energy", "J/m"), ("inclusion_residual", ""), ("x", "m"), ("normal_velocity", "m/s"), ("gap", "m"),
        ]:  # fmt: skip
            self.assertEqual(units[name], unit, name)
        of_space = [declared.unit("resultants.csv", name, False) for name in ("force_x", "moment_z", "obstacle_angular_velocity")]
        self.assertEqual(of_space, ["N", "N m", "rad/s"])
        self.assertEqual(declared.unit("fields.vtkhdf", "principal_stress_2", True), "Pa")
        for name, unit in [
            ("max_von_mises", "Pa"), ("certificates.viscosity_modulus", "Pa s"), ("certificates.growth_constants.1", "Pa s/m"),
            ("wall_seconds.total", "s"), ("error_indicator", "√(J/m)"), ("steps", ""), ("no.such", ""),
        ]:  # fmt: skip
            self.assertEqual(declared.unit_of_member(name, True), unit, name)


class Folders(unittest.TestCase):
    def test_folders_without_results_are_refused(self) -> None:
        folder = sample.folder()
        with self.assertRaisesRegex(clarke.NoResults, "not the output folder of a run"):
            clarke.open(folder)
        with self.assertRaisesRegex(clarke.NoResults, "is not a folder"):
            clarke.open(folder / "out")
        (folder / "study.json").write_text("{}")
        with self.assertRaisesRegex(clarke.NoResults, "open_sweep"):
            clarke.open(folder)

    def test_a_running_job_can_be_watched_and_a_killed_one_read(self) -> None:
        folder = sample.folder() / "out"
        job = sample.folder() / "job.toml"
        job.write_text(clarke.dumps(sample.sliding_block(time={"end": 1e4, "step": 0.001})))
        command = [program.find(), "-q", str(job), "--set", f'output.folder="{folder}"']
        child = subprocess.Popen(command, stdout=subprocess.DEVNULL)
        self.addCleanup(child.kill)
        _wait_for(lambda: (folder / "history.csv").exists() and (folder / "history.csv").stat().st_size > 1000)
        run = clarke.open(folder)
        self.assertEqual(run.status, "running")
        self.assertGreater(run.columns("history").rows, 1)
        with self.assertRaisesRegex(clarke.Unfinished, "still going on"):
            run.summary
        with self.assertRaisesRegex(clarke.Refused, "another run is writing"):
            clarke.run(job, folder=folder, quiet=True)
        child.send_signal(signal.SIGKILL)
        child.wait()
        self.assertEqual(run.status, "killed")
        with self.assertRaisesRegex(clarke.Unfinished, "was killed"):
            run.summary
        self.assertGreater(run.columns("history").rows, 1)

    def test_damaged_files_are_named(self) -> None:
        folder = copied()
        for name, words in [("summary.json", "no JSON"), ("job.toml", "no TOML")]:
            (folder / name).write_text("{ [")
            with self.assertRaisesRegex(clarke.Damaged, f"{name} is {words}"):
                clarke.open(folder).summary if name == "summary.json" else clarke.open(folder).job
        (folder / "summary.json").write_text("[]")
        with self.assertRaisesRegex(clarke.Damaged, "has no status"):
            clarke.open(folder).status

    def test_expected_results_are_compared(self) -> None:
        checks = sample.finished().check()
        self.assertEqual([check.name for check in checks], ["max_energy_imbalance", "probe.centre.displacement_x"])
        self.assertTrue(all(check.passed for check in checks), checks)
        folder = copied()
        text = (folder / "job.toml").read_text()
        self.assertIn("value = 0.10144", text)
        (folder / "job.toml").write_text(text.replace("value = 0.10144", "value = 0.1016"))
        self.assertEqual([check.passed for check in clarke.open(folder).check()], [True, False])
        more = '[check."history.mean.dt"]\nvalue = 0.001\nrelative = 0.1\n[check."history.dt"]\nvalue = "2*V"\nrelative = 0.1\n'
        (folder / "job.toml").write_text(text + more)
        last = clarke.open(folder).check()[-2:]
        self.assertEqual([check.passed for check in last], [True, None])
        self.assertRegex(last[1].note, "formula")

    def test_quantities_are_read_where_their_names_say(self) -> None:
        run = sample.finished()
        history, pressure = run.columns("history"), run.columns("profiles")["contact_pressure"]
        for name, value in [
            ("max_von_mises", run.summary["max_von_mises"]),
            ("certificates.viscosity_modulus", 1e6),
            ("history.dt", history["dt"][-1]),
            ("history.max.kinetic_energy", max(history["kinetic_energy"])),
            ("probe.first.velocity_x", run.columns("probes", of="first")["velocity_x"][-1]),
            ("probe.foot.min.displacement_x", run.columns("probes", of="foot")["displacement_x"][0]),
            ("profile.bottom.max.contact_pressure", max(pressure[-9:])),
            ("profile.bottom.first.contact_pressure", pressure[-9]),
        ]:
            self.assertEqual(run.quantity(name), value, name)
        for name, words in [
            ("history.period.dt", "no period"),
            ("history.top.dt", "top is no extremum"),
            ("history.energy", "no column energy"),
            ("status", "no number status"),
            ("probe.tip.velocity_x", "no probe 'tip'"),
            ("certificates.step_range", "no number"),
        ]:
            with self.assertRaisesRegex(clarke.Error, words):
                run.quantity(name)

    def test_the_program_writes_the_report(self) -> None:
        folder = copied()
        page = clarke.open(folder).report()
        self.assertEqual(page, folder / "report/index.html")
        self.assertIn("</html>", page.read_text())
        os.remove(folder / "job.toml")
        os.remove(folder / "summary.json")
        for table in folder.glob("*.csv"):
            table.unlink()
        with self.assertRaisesRegex(clarke.RunError, "is not the output folder of a run"):
            clarke.Results(folder).report()


@sample.needs("h5py", "pyvista")
class Fields(unittest.TestCase):
    def test_fields_are_those_that_vtk_reads_at_every_time(self) -> None:
        runs = [sample.finished()]
        box = {
            "mesh": {"box": {"size": [1.0, 1.0, 1.0], "cells": [2, 2, 2]}, "order": 2},
            "material": {"elasticity": {"youngs_modulus": 1e3, "poisson_ratio": 0.3}},
            "support": [{"on": ["bottom"], "fix": "all"}],
            "traction": [{"on": ["top"], "value": [1.0, 0.0, "-t"]}],
            "time": {"scheme": "implicit_euler", "end": 1.0, "step": 0.25},
            "output": {"fields": {"every": 2}},
        }
        runs.append(clarke.run(box, folder=sample.folder() / "out", ranks=2, quiet=True))
        self.assertEqual([run.times for run in runs], [[0.0, 0.1, 0.2, 0.25], [0.0, 0.5, 1.0]])
        for run in runs:
            for time in run.times:
                self.compare(run.fields(time), run.folder / "fields.vtkhdf", time)

    def compare(self, grid, path: Path, time: float) -> None:  # type: ignore[no-untyped-def]
        import numpy
        import pyvista
        from vtkmodules.vtkIOHDF import vtkHDFReader

        reader = vtkHDFReader()
        reader.SetFileName(str(path))
        reader.UpdateTimeStep(time)
        theirs = pyvista.wrap(reader.GetOutputDataObject(0))
        self.assertEqual(grid.user_dict["time"], time)
        self.assertTrue(numpy.array_equal(grid.points, theirs.points))
        self.assertTrue(numpy.array_equal(grid.cell_connectivity, theirs.cell_connectivity))
        self.assertTrue(numpy.array_equal(grid.celltypes, theirs.celltypes))
        for mine, other in [(grid.point_data, theirs.point_data), (grid.cell_data, theirs.cell_data)]:
            self.assertGreaterEqual(set(mine), {"displacement"} if "displacement" in other else {"stress"})
            for name in mine:
                self.assertTrue(numpy.array_equal(mine[name], other[name]), name)

    def test_the_last_time_is_the_default_and_others_are_exact_unless_the_nearest_will_do(self) -> None:
        run = sample.finished()
        self.assertEqual(run.fields().user_dict["time"], 0.25)
        self.assertEqual(run.fields(0.13, nearest=True).user_dict["time"], 0.1)
        with self.assertRaisesRegex(clarke.Error, "nearest output time is 0.1 s"):
            run.fields(0.13)
        self.assertEqual(run.fields().user_dict["units"]["stress"], "Pa")

    def test_an_output_that_is_not_complete_is_left_out(self) -> None:
        import h5py

        folder = copied()
        with h5py.File(folder / "fields.vtkhdf", "r+") as file:
            file["VTKHDF/Steps"].attrs["NSteps"] = 3
            del file["VTKHDF/PointData/displacement"]
            file["VTKHDF/PointData/displacement"] = file["VTKHDF/PointData/velocity"][: 3 * 27]
        run = clarke.open(folder)
        self.assertEqual(run.times, [0.0, 0.1, 0.2])
        self.assertEqual(run.fields().user_dict["time"], 0.2)
        with h5py.File(folder / "fields.vtkhdf", "r+") as file:
            file["VTKHDF/Steps"].attrs["NSteps"] = 0
        with self.assertRaisesRegex(clarke.NoResults, "no complete output time"):
            run.fields()

    def test_damaged_and_missing_files_are_named(self) -> None:
        folder = copied()
        path = folder / "fields.vtkhdf"
        whole = path.read_bytes()
        for part in (whole[:5000], b""):
            path.write_bytes(part)
            with self.assertRaisesRegex(clarke.Damaged, "cannot be read"):
                clarke.open(folder).fields()
        path.unlink()
        with self.assertRaisesRegex(clarke.NoResults, "has written no fields yet"):
            clarke.open(folder).times

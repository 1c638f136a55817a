"""Sweeps against single runs."""

import contextlib
import io
import json
import math
import unittest
from typing import Any

import clarke

from . import sample

COEFFICIENT = "contact.0.friction.coulomb.coefficient"
DISPLACEMENT = "probe.centre.displacement_x"


class Sweeps(unittest.TestCase):
    def test_rows_are_those_of_single_runs_and_finished_runs_are_reused(self) -> None:
        folder = sample.folder()
        job = folder / "job.toml"
        job.write_text(clarke.dumps(sample.sliding_block()))
        responses: list[Any] = [DISPLACEMENT, {"of": "history.mean.kinetic_energy", "to": 0.1}, "max_von_mises"]
        with contextlib.redirect_stdout(io.StringIO()) as shown:
            sweep = clarke.sweep(job, {COEFFICIENT: [0.5, 1.0]}, responses, folder=folder / "sweep", ranks=2)
        table = sweep.columns
        self.assertIn("2 runs side by side", shown.getvalue())
        self.assertEqual((table[COEFFICIENT], table["status"]), ([0.5, 1.0], ["completed"] * 2))
        self.assertAlmostEqual(table[DISPLACEMENT][0], sample.finished().quantity(DISPLACEMENT), delta=1e-9)
        self.assertEqual(table[DISPLACEMENT][1], sweep.run(table["run"][1]).quantity(DISPLACEMENT))
        # v0^2 / (2 mu g) - k v0 / 2
        self.assertAlmostEqual(table[DISPLACEMENT][1], 1 / (2 * 9.81) - 0.0005, delta=1e-4)
        self.assertEqual([table.units[name] for name in list(table)[-3:]], ["m", "J/m", "Pa"])
        self.assertEqual(sweep.failed, {})
        again = clarke.sweep(job, {COEFFICIENT: [0.5, 1.0]}, responses, folder=folder / "sweep", quiet=True)
        self.assertEqual([run["found"] for run in again.study["runs"]], [True, True])
        study = clarke.load(folder / "sweep/study.toml")
        self.assertEqual(study["sweep"], {COEFFICIENT: [0.5, 1.0]})
        self.assertEqual(clarke.open_sweep(folder / "sweep").columns["run"], table["run"])

    def test_jobs_in_memory_sweep_over_words_and_draws(self) -> None:
        vary = {"time.scheme": ["implicit_euler", "bdf2"], "initial.velocity.0": {"from": 0.5, "to": 1.0, "draws": 2, "seed": 3}}
        changes = {"time.end": 0.01, "parameters.spare": 1.0}
        sweep = clarke.sweep(
            sample.sliding_block(), vary, [DISPLACEMENT], folder=sample.folder() / "sweep", set=changes, quiet=True
        )
        table = sweep.columns
        # A parameter that nothing uses is warned of.
        self.assertEqual((list(sweep.warnings), table["warnings"]), (table["run"], [1.0] * 4))
        self.assertIn("spare", sweep.warnings[table["run"][0]][0])
        self.assertEqual(sorted(table["time.scheme"]), ["bdf2", "bdf2", "implicit_euler", "implicit_euler"])
        self.assertTrue(all(0.5 <= speed <= 1.0 for speed in table["initial.velocity.0"]))
        self.assertFalse((sweep.folder / "study.toml").exists())

    def test_numbers_over_time_are_those_that_a_run_gives_from_its_own_tables(self) -> None:
        responses = [f"probe.centre.{side}.velocity_x" for side in ("mean", "amplitude", "period", "arrival")]
        # Without friction the velocity is 1 m/s + (1 - cos(40 pi t))/(40 pi) m/s.
        changes = {"body_force.0.value.0": "1e3*sin(40*pi*t)", "check": {responses[2]: {"value": 0.05, "relative": 1e-2}}}
        sweep = clarke.sweep(
            sample.sliding_block(), {COEFFICIENT: [0.0]}, responses, folder=sample.folder() / "sweep", set=changes, quiet=True
        )
        (name,) = sweep.columns["run"]
        for response in responses:
            self.assertAlmostEqual(sweep.columns[response][0], sweep.run(name).quantity(response), delta=1e-12)
        self.assertAlmostEqual(sweep.columns[responses[2]][0], 0.05, delta=1e-3)

    def test_refused_members_are_listed_and_the_others_have_values(self) -> None:
        with contextlib.redirect_stderr(io.StringIO()) as shown:
            sweep = clarke.sweep(
                sample.sliding_block(), {COEFFICIENT: [-1.0, 0.5]}, [DISPLACEMENT],
                folder=sample.folder() / "sweep", set={"time.end": 0.01}, quiet=True,
            )  # fmt: skip
        values = dict(zip(sweep.columns[COEFFICIENT], sweep.columns[DISPLACEMENT], strict=True))
        self.assertTrue(math.isnan(values[-1.0]) and values[0.5] > 0)
        self.assertEqual(list(sweep.failed), ["coefficient--1.0"])
        self.assertIn("allowed: at least 0", sweep.failed["coefficient--1.0"])
        self.assertIn("coefficient--1.0", shown.getvalue())

    def test_bad_sweeps_are_refused(self) -> None:
        folder = sample.folder() / "sweep"
        for vary, responses, words in [
            ({"time.stp": [1.0]}, [DISPLACEMENT], "stp"),
            ({COEFFICIENT: [0.5]}, ["probe.tip.displacement_x"], "tip"),
        ]:
            with self.assertRaisesRegex(clarke.Refused, words):
                clarke.sweep(sample.sliding_block(), vary, responses, folder=folder, quiet=True)
        with self.assertRaisesRegex(clarke.Error, "keys to vary"):
            clarke.sweep(sample.sliding_block(), {}, [DISPLACEMENT], folder=folder)
        with self.assertRaisesRegex(clarke.NoResults, "no responses.csv"):
            clarke.open_sweep(folder)

    def test_a_study_that_fails_as_a_whole_does_not_give_the_table_of_an_earlier_one(self) -> None:
        folder = sample.folder()
        (folder / "sweep").mkdir()
        (folder / "sweep/responses.csv").write_text("run\n")
        failing = sample.script(folder / "failing", "echo 'error: the disk is full' >&2; exit 1")
        with self.assertRaisesRegex(clarke.Failed, "disk is full"):
            clarke.sweep(sample.sliding_block(), {COEFFICIENT: [0.5]}, [DISPLACEMENT], folder=folder / "sweep", solver=failing)

    @sample.needs("pandas")
    def test_frames_have_the_units(self) -> None:
        sweep = clarke.sweep(
            sample.sliding_block(), {COEFFICIENT: [0.5]}, [DISPLACEMENT],
            folder=sample.folder() / "sweep", set={"time.end": 0.002}, quiet=True,
        )  # fmt: skip
        self.assertEqual(sweep.frame.attrs["units"][DISPLACEMENT], "m")
        self.assertEqual(len(sweep.frame), 1)
        self.assertEqual(json.loads((sweep.folder / "study.json").read_text())["sweep"], [COEFFICIENT])

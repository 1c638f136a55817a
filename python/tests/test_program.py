"""Finding and running the program; its refusals and failures."""

import contextlib
import io
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import time
import unittest
from collections.abc import Callable
from unittest import mock

import clarke
from clarke import program

from . import sample


# Programs in the background of a script ignore interrupts, and so do those that they start.
INTERRUPTIBLE = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)\n"


class Finding(unittest.TestCase):
    def test_the_argument_comes_first_then_the_variable_then_the_path(self) -> None:
        folder = sample.folder()
        one, two = (sample.script(folder / name, "exit 0") for name in ("one", "two"))
        with mock.patch.dict(os.environ, {"CLARKE_SOLVER": str(two), "PATH": str(folder)}):
            self.assertEqual(program.find(one), str(one))
            self.assertEqual(program.find(), str(two))
            del os.environ["CLARKE_SOLVER"]
            on_path = sample.script(folder / "solver", "exit 0")
            self.assertEqual(program.find(), str(on_path))

    def test_a_build_is_found_from_folders_below_it(self) -> None:
        folder = sample.folder()
        built = folder / "target/release/solver"
        built.parent.mkdir(parents=True)
        sample.script(built, "exit 0")
        (folder / "jobs").mkdir()
        here = os.getcwd()
        with mock.patch.dict(os.environ, {"PATH": ""}):
            os.environ.pop("CLARKE_SOLVER", None)
            try:
                os.chdir(folder / "jobs")
                self.assertEqual(program.find(), str(built))
            finally:
                os.chdir(here)

    def test_a_missing_program_is_named_with_what_to_do(self) -> None:
        with self.assertRaisesRegex(clarke.SolverMissing, "^solver=/no/solver is not a program"):
            clarke.run("job.toml", solver="/no/solver")
        with mock.patch.dict(os.environ, {"CLARKE_SOLVER": "/no/solver"}):
            with self.assertRaisesRegex(clarke.SolverMissing, "^CLARKE_SOLVER=/no/solver"):
                clarke.describe()
        with (
            mock.patch.dict(os.environ, {"PATH": ""}),
            mock.patch.object(program, "BUILT", pathlib.Path("no/solver")),
        ):
            os.environ.pop("CLARKE_SOLVER", None)
            with self.assertRaisesRegex(clarke.SolverMissing, "make build.*CLARKE_SOLVER"):
                clarke.validate("job.toml")

    def test_a_missing_launcher_is_named(self) -> None:
        with self.assertRaisesRegex(clarke.SolverMissing, "no-mpirun, which starts the program on 2 ranks"):
            clarke.run("job.toml", ranks=2, launcher="no-mpirun")
        with self.assertRaisesRegex(ValueError, "at least 1"):
            clarke.run("job.toml", ranks=0)


class Running(unittest.TestCase):
    def test_a_run_gives_its_results_and_shows_its_lines(self) -> None:
        shown = io.StringIO()
        with contextlib.redirect_stdout(shown):
            run = clarke.run(sample.sliding_block(), folder=sample.folder() / "out", set={"time.end": 0.01})
        self.assertEqual((run.status, run.summary["steps"], run.summary["ranks"]), ("completed", 10, 1))
        self.assertIn("completed     10 steps", shown.getvalue())

    def test_a_file_runs_where_it_says_and_names_need_no_quotes(self) -> None:
        folder = sample.folder()
        job = folder / "a b; $(touch it) 'c'.toml"
        job.write_text(clarke.dumps(sample.sliding_block(time={"end": 0.002, "step": 0.001})))
        run = clarke.run(job, quiet=True)
        self.assertEqual(run.folder, folder / "out" / job.stem)
        self.assertEqual(run.columns("history")["step"], [1, 2])
        other = clarke.run(job, set={"output.folder": "other"}, quiet=True)
        self.assertEqual(other.folder, folder / "other")
        loaded = clarke.load(job)
        loaded["output"]["folder"] = "third"
        self.assertEqual(clarke.run(loaded, quiet=True).folder, folder / "third")
        self.assertEqual(sorted(os.listdir(folder)), sorted([job.name, "other", "out", "third"]))

    def test_a_job_without_a_place_for_its_results_is_refused(self) -> None:
        with self.assertRaisesRegex(clarke.Error, "needs folder="):
            clarke.run(sample.sliding_block())
        with self.assertRaisesRegex(clarke.Error, "once"):
            clarke.run(sample.sliding_block(), folder="a", set={"output.folder": "b"})

    def test_a_refused_job_says_what_the_program_says_on_one_rank_and_two(self) -> None:
        for ranks in (1, 2):
            with self.assertRaises(clarke.Refused) as caught, contextlib.redirect_stderr(io.StringIO()) as shown:
                clarke.run(sample.sliding_block(), ranks=ranks, set={"time.stp": 1}, folder=sample.folder() / "out")
            text = str(caught.exception)
            self.assertTrue(text.startswith("error: unknown key `stp` in [time]"), text)
            self.assertTrue(text.endswith("1 fault in the job"), text)
            self.assertEqual(caught.exception.code, 2)
            self.assertIn("unknown key `stp`", shown.getvalue())

    def test_a_missing_job_is_refused_by_the_program(self) -> None:
        with self.assertRaisesRegex(clarke.Refused, "there is no job file of this name"):
            clarke.run(sample.folder() / "job.toml")
        with self.assertRaisesRegex(clarke.Refused, "no job file"):
            clarke.validate("-x.toml")

    def test_results_of_another_job_are_kept_unless_forced(self) -> None:
        folder = sample.folder() / "out"
        short = {"time.end": 0.003}
        clarke.run(sample.sliding_block(), folder=folder, set=short, quiet=True)
        other = short | {"contact.0.friction.coulomb.coefficient": 0.4}
        with self.assertRaisesRegex(clarke.Refused, "--force"):
            clarke.run(sample.sliding_block(), folder=folder, set=other, quiet=True)
        run = clarke.run(sample.sliding_block(), folder=folder, set=other, quiet=True, force=True)
        self.assertEqual(run.job["contact"][0]["friction"]["coulomb"]["coefficient"], 0.4)

    def test_a_restart_continues_from_the_newest_checkpoint_or_a_given_one(self) -> None:
        folder = sample.folder() / "out"
        job = sample.sliding_block(checkpoint={"every": 10, "keep": 5})
        clarke.run(job, folder=folder, set={"time.end": 0.02}, quiet=True)
        starts: list[tuple[bool | pathlib.Path, int]] = [(True, 30), (folder / "checkpoint-20.h5", 40)]
        for restart, steps in starts:
            run = clarke.run(job, folder=folder, set={"time.end": steps / 1000}, restart=restart, quiet=True)
            self.assertEqual(run.columns("history")["step"], list(range(1, steps + 1)))
        self.assertTrue(run.summary["restarted_from"].endswith("checkpoint-20.h5"))

    def test_a_failed_run_raises_and_keeps_its_folder(self) -> None:
        folder = sample.folder() / "out"
        with self.assertRaises(clarke.Failed) as caught:
            job = sample.sliding_block(body_force=[{"value": ["sqrt(0.005 - t)", 0]}])
            clarke.run(job, folder=folder, quiet=True)
        self.assertEqual((caught.exception.code, caught.exception.folder), (1, folder))
        run = clarke.open(folder)
        self.assertEqual(run.status, "failed")
        self.assertIn(run.summary["error"].split("\n")[0][:40], str(caught.exception))

    def test_a_limit_stops_a_run_with_a_checkpoint(self) -> None:
        folder = sample.folder() / "out"
        job = sample.sliding_block(checkpoint={"wall_limit": 0.3})
        with self.assertRaisesRegex(clarke.Stopped, "^stopping on the wall-time limit of 0.3 s"):
            clarke.run(job, folder=folder, set={"time.end": 1e4}, quiet=True)
        self.assertEqual(clarke.open(folder).status, "stopped")
        self.assertTrue(list(folder.glob("checkpoint-*.h5")))

    def test_an_interrupt_stops_a_run_with_a_checkpoint(self) -> None:
        folder = sample.folder() / "out"
        job = sample.sliding_block()
        code = (
            f"{INTERRUPTIBLE}import clarke, sys\n"
            f"try: clarke.run({job!r}, folder={str(folder)!r}, ranks=2, set={{'time.end': 1e4}}, quiet=True)\n"
            "except clarke.Stopped as stop: sys.exit(33 if 'stopping on' in str(stop) else 34)\n"
        )
        child = subprocess.Popen([sys.executable, "-c", code], stderr=subprocess.DEVNULL, env=_with_package())
        self.addCleanup(child.kill)
        _wait_for(lambda: (folder / "history.csv").exists() and (folder / "history.csv").stat().st_size > 1000)
        child.send_signal(signal.SIGINT)
        self.assertEqual(child.wait(timeout=30), 33)
        self.assertTrue(list(folder.glob("checkpoint-*.h5")))

    def test_an_interrupt_of_what_can_not_stop_so_is_an_interrupt(self) -> None:
        folder = sample.folder()
        begun = folder / "begun"
        sleeping = sample.script(folder / "sleeping", f"touch '{begun}'; exec sleep 30")
        code = f"{INTERRUPTIBLE}import clarke; clarke.describe('time', solver={str(sleeping)!r})"
        child = subprocess.Popen([sys.executable, "-c", code], stderr=subprocess.PIPE, text=True, env=_with_package())
        self.addCleanup(child.kill)
        _wait_for(begun.exists)
        child.send_signal(signal.SIGINT)
        self.assertIn("KeyboardInterrupt", child.communicate(timeout=10)[1])

    def test_a_program_that_ends_otherwise_is_an_internal_fault(self) -> None:
        folder = sample.folder()
        for line, code, words in [("kill -9 $$", -9, "SIGKILL"), ("echo broken; exit 4", 4, "broken")]:
            false_solver = sample.script(folder / "false", line)
            with self.assertRaisesRegex(clarke.InternalFault, words) as caught:
                clarke.run(sample.sliding_block(), folder=folder / "out", solver=false_solver)
            self.assertEqual(caught.exception.code, code)

    def test_single_ranks_have_a_folder_of_open_mpi_of_their_own_as_long_as_they_run(self) -> None:
        folder = sample.folder()
        show = sample.script(folder / "show", 'test -d "$OMPI_MCA_orte_tmpdir_base" && echo "$OMPI_MCA_orte_tmpdir_base"')
        one, other, of_launcher = (program.start([str(show)], show=False, ranks=ranks).output.strip() for ranks in (1, 1, 2))
        self.assertEqual(len({one, other, sample.WORK.name, ""}), 4)
        self.assertFalse(os.path.exists(one))
        self.assertEqual(of_launcher, sample.WORK.name)

    def test_much_output_on_both_streams_does_not_block(self) -> None:
        lines = "i=0; while [ $i -lt 4000 ]; do echo 0123456789012345678901234567890123456789; echo error $i >&2; i=$((i+1)); done"
        signal.signal(signal.SIGALRM, lambda *_: self.fail("blocked"))
        self.addCleanup(signal.alarm, 0)
        signal.alarm(20)
        ended = program.start([str(sample.script(sample.folder() / "loud", lines))], show=False)
        self.assertEqual((len(ended.output), ended.errors.count("error")), (41 * 4000, 4000))


class Asking(unittest.TestCase):
    def test_a_valid_job_is_described_without_a_run(self) -> None:
        folder = sample.folder()
        job = clarke.Job(sample.sliding_block(), folder, "block")
        found = clarke.validate(job, ranks=2, set={"time.end": 0.5})
        self.assertEqual((found["ranks"], found["cells"], found["steps"]), (2, 32, 500))
        self.assertAlmostEqual(found["bodies"][0]["mass"], 40.0)
        self.assertEqual(found["output_folder"], str(folder / "out/block"))
        self.assertEqual(os.listdir(folder), [])

    def test_an_invalid_job_is_refused_with_all_faults(self) -> None:
        job = sample.sliding_block(time={"end": -1.0, "stp": 1.0})
        with self.assertRaisesRegex(clarke.Refused, "(?s)unknown key `stp`.*2 faults in the job"):
            clarke.validate(job)

    def test_keys_are_described(self) -> None:
        self.assertIn("contact.friction.coulomb.coefficient", clarke.describe("friction"))
        self.assertIn("required", clarke.describe("sweep.draws", study=True))
        with self.assertRaisesRegex(clarke.Refused, "no table of a job is called `nothing`"):
            clarke.describe("nothing")


def _with_package() -> dict[str, str]:
    return os.environ | {"PYTHONPATH": str(sample.ROOT / "python")}


def _wait_for(is_so: Callable[[], bool]) -> None:
    end = time.monotonic() + 10
    while not is_so():
        if time.monotonic() > end:
            raise AssertionError("it did not happen within 10 s")
        time.sleep(0.02)


if shutil.which("mpirun") is None:
    raise RuntimeError("these tests need mpirun")

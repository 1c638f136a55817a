"""Sweeps: studies of the program that vary keys of a job."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from . import declared, jobs, program, tables
from .commands import JobLike, PathLike
from .errors import Damaged, Error, NoResults
from .results import TABLES, Results, file_of
from .results import open as open_results

if TYPE_CHECKING:
    import pandas

RESPONSES = "responses.csv"
# Behind the names of responses in a window of time.
WINDOW = re.compile(r" \((from|to) [^()]*\)$")


def sweep(
    job: JobLike,
    vary: Mapping[str, Any],
    responses: Sequence[str | Mapping[str, Any]],
    *,
    folder: PathLike,
    ranks: int = 1,
    ranks_of_run: int | None = None,
    set: Mapping[str, Any] | None = None,
    quiet: bool = False,
    solver: PathLike | None = None,
    launcher: str = "mpirun",
) -> Sweep:
    """Runs a job with every combination of values of its keys, as a study of the program, and returns its table.

    `vary` has a list of values for each key, as in `{"contact.0.friction.coulomb.coefficient": [0.1, 0.2]}`, or random values,
    `{"from": 0.1, "to": 0.4, "draws": 8}`. `responses` are quantities as in `[check]` of a job, also means, amplitudes and periods; with
    a window of time in s: `{"of": .., "from": 1.0}`. As many runs execute side by side as there are `ranks`, or these over `ranks_of_run`.
    Finished runs in the folder are reused. Runs that fail are listed in `failed`, and do not raise; those that warn in `warnings`.
    """
    target = Path(folder).absolute()
    if not vary or not responses:
        raise Error("a sweep needs keys to vary and responses")
    command = program.on_ranks(ranks, program.find(solver), launcher)
    with jobs.as_file(job) as file:
        study: dict[str, Any] = {
            "base": {"job": str(file.absolute()), "set": jobs.overrides(set or {})},
            "sweep": dict(vary),
            "response": [{"of": of} if isinstance(of, str) else dict(of) for of in responses],
            "output": {"folder": str(target)},
        }
        if ranks_of_run is not None:
            study["timing"] = {"ranks": ranks_of_run}
        before = _written(target)
        with jobs.as_file(jobs.Job(study, _made(target.parent))) as study_file:
            ended = program.start([*command, "study", *["--quiet"] * quiet, "--", str(study_file)], ranks=ranks)
    # Exit code 1: some runs have failed, and the tables are written.
    ended.refuse(target, accepted=(0, 1) if _written(target) != before else (0,))
    if not isinstance(job, Mapping):
        (target / "study.toml").write_text(jobs.dumps(study), encoding="utf-8")
    return Sweep(target)


def _written(folder: Path) -> int | None:
    """When the table of a sweep was written, in ns."""
    try:
        return (folder / RESPONSES).stat().st_mtime_ns
    except FileNotFoundError:
        return None


def _made(folder: Path) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def open_sweep(folder: str | os.PathLike[str]) -> Sweep:
    """The results in the folder of a sweep, also of one that `solver study` has run."""
    path = Path(folder)
    if not (path / RESPONSES).exists():
        raise NoResults(f"{path} has no responses.csv, which a study with [sweep] and [[response]] writes at its end")
    return Sweep(path)


class Sweep:
    """The results of a sweep."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def __repr__(self) -> str:
        return f"Sweep({str(self.folder)!r}, {len(self.study['runs'])} runs)"

    @property
    def study(self) -> dict[str, Any]:
        """`study.json`, all results of the study."""
        path = self.folder / "study.json"
        try:
            found = json.loads(path.read_text(encoding="utf-8"))
        except FileNotFoundError:
            raise NoResults(f"{path} is not there") from None
        except ValueError as error:
            raise Damaged(f"{path} is no JSON: {error}") from error
        assert isinstance(found, dict)
        return found

    @property
    def columns(self) -> tables.Table:
        """A row for each run: its name, the values of the keys, `status`, the number of `warnings`, and the responses, `nan` where a run
        failed."""
        header, rows = tables.records(self.folder / RESPONSES)
        columns: dict[str, list[Any]] = {}
        for at, name in enumerate(header):
            entries = [tables.unguarded(row[at]) for _, row in rows]
            columns[name] = entries if name in ("run", "status") else _numbers_or_words(entries)
        responses = self.study["response"]
        is_plane = self._is_plane()
        units = {name: _unit(name, is_plane) if name in responses else "" for name in header}
        return tables.Table(columns, units)

    def _is_plane(self) -> bool:
        for run in self.study["runs"]:
            if (self.folder / "runs" / run["name"] / "job.toml").exists():
                return self.run(run["name"])._is_plane
        return False

    @property
    def frame(self) -> pandas.DataFrame:
        """`columns` for pandas, with the units of the responses in `attrs["units"]`."""
        return self.columns.frame()

    @property
    def failed(self) -> dict[str, str]:
        """The runs that failed or were refused, with the reason."""
        return {run["name"]: str(run["error"]) for run in self.study["runs"] if run["status"] != "completed"}

    @property
    def warnings(self) -> dict[str, list[str]]:
        """The warnings of the runs that have any; `columns` has their numbers."""
        return {run["name"]: run["warnings"] for run in self.study["runs"] if run["warnings"]}

    def run(self, name: str) -> Results:
        """The results of a run by its name in the table."""
        return open_results(self.folder / "runs" / name)


def _numbers_or_words(entries: list[str]) -> list[Any]:
    try:
        return [float(entry) if entry else float("nan") for entry in entries]
    except ValueError:
        return list(entries)


def _unit(response: str, is_plane: bool) -> str:
    word, _, rest = WINDOW.sub("", response).partition(".")
    if word not in TABLES:
        return declared.unit_of_member(WINDOW.sub("", response), is_plane)
    if ".period." in rest or ".arrival." in rest:
        return "s"
    return declared.unit(file_of(word), rest.rpartition(".")[2], is_plane)

"""The output folder of a run."""

from __future__ import annotations

import fcntl
import json
import math
import os
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from . import fields, over_time, program, tables
from .errors import Damaged, Error, NoResults, Unfinished

if TYPE_CHECKING:
    import pandas
    import pyvista

# The first word of a quantity in [check] and the table that it names, with the column of the name behind it.
TABLES = {"history": "", "resultant": "source", "probe": "probe", "profile": "profile"}


def file_of(word: str) -> str:
    """The file of a table."""
    return "history.csv" if word == "history" else f"{word}s.csv"


@dataclass(frozen=True)
class Check:
    """An expected result of a job, in the unit of the quantity.

    `passed` is `None` where this package cannot tell, for the reason in `note`.
    """

    name: str
    expected: float | str
    value: float
    passed: bool | None
    note: str = ""


def open(folder: str | os.PathLike[str]) -> Results:
    """The results in the output folder of a run, which may still be going on."""
    path = Path(folder)
    if not path.is_dir():
        raise NoResults(f"{path} is not a folder")
    if (path / "study.json").exists() and not (path / "job.toml").exists():
        raise NoResults(f"{path} has the results of a study: clarke.open_sweep reads them")
    if not any((path / name).exists() for name in ("job.toml", "summary.json", "history.csv")):
        raise NoResults(f"{path} is not the output folder of a run: it has no job.toml, summary.json or history.csv")
    return Results(path)


class Results:
    """What a run has written. Every property reads its file when it is used, so that a running job can be watched."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def __repr__(self) -> str:
        return f"Results({str(self.folder)!r}, {self.status})"

    @property
    def status(self) -> str:
        """`completed`, `stopped` or `failed`, as the program says; `running`; or `killed`, without an end."""
        if _is_locked(self.folder / "run.log"):
            return "running"
        try:
            return str(self._summary()["status"])
        except Unfinished:
            return "killed"

    @property
    def summary(self) -> dict[str, Any]:
        """`summary.json`: sizes, certificates, costs, largest values; docs/reference-outputs.md has the units."""
        if _is_locked(self.folder / "run.log"):
            raise Unfinished(f"{self.folder}: the run is still going on and writes its summary at the end")
        return self._summary()

    def _summary(self) -> dict[str, Any]:
        path = self.folder / "summary.json"
        try:
            found = json.loads(path.read_text(encoding="utf-8"))
        except FileNotFoundError:
            raise Unfinished(f"{path} is not there: the run was killed; restart=True continues from a checkpoint") from None
        except ValueError as error:
            raise Damaged(f"{path} is no JSON: {error}") from error
        if not isinstance(found, dict) or "status" not in found:
            raise Damaged(f"{path} has no status")
        return found

    @property
    def job(self) -> dict[str, Any]:
        """The effective job, with every default."""
        path = self.folder / "job.toml"
        try:
            return tomllib.loads(path.read_text(encoding="utf-8"))
        except FileNotFoundError:
            raise NoResults(f"{path} is not there") from None
        except ValueError as error:
            raise Damaged(f"{path} is no TOML: {error}") from error

    @property
    def _is_plane(self) -> bool:
        return str(self.job.get("material", {}).get("hypothesis", "")).startswith("plane")

    def columns(self, table: str, of: str | None = None) -> tables.Table:
        """A table as plain lists: `history`, `resultants`, `probes` or `profiles`; only the rows `of` a source, probe or profile."""
        word = table.removesuffix("s") if table != "history" else table
        if word not in TABLES:
            raise Error(f"no table {table!r}; there are history, resultants, probes and profiles")
        path = self.folder / file_of(word)
        if not path.exists():
            reasons = {"probe": "the job has no [[output.probe]]", "profile": "the job has no [[output.profile]]"}
            raise NoResults(f"{path} is not there: {reasons.get(word, 'the run has made no step yet')}")
        whole = tables.read(path, self._is_plane)
        key = TABLES[word]
        if of is None:
            return whole
        if not key:
            raise Error("history has one row for each step, of nothing in particular")
        if of not in whole[key]:
            raise Error(f"{path.name} has no {key} {of!r}; there are {', '.join(sorted(set(whole[key])))}")
        return whole.where(**{key: of})

    @property
    def history(self) -> pandas.DataFrame:
        """A row for each step: iterations, residuals, energies. Units are in `attrs["units"]`, as of all tables."""
        return self.columns("history").frame()

    @property
    def resultants(self) -> pandas.DataFrame:
        """A row for each step and source: forces and moments on the body."""
        return self.columns("resultants").frame()

    @property
    def contacts(self) -> pandas.DataFrame:
        """The rows of `resultants` that have areas and pressures: those of contacts."""
        frame = self.resultants
        if "touching_area" not in frame:
            raise NoResults(f"{self.folder}: the job has no contact")
        return frame[frame["touching_area"].notna()].reset_index(drop=True)

    @property
    def probes(self) -> pandas.DataFrame:
        """A row for each step and probe."""
        return self.columns("probes").frame()

    @property
    def profiles(self) -> pandas.DataFrame:
        """A row for each output time, profile and node of its boundary."""
        return self.columns("profiles").frame()

    @property
    def times(self) -> list[float]:
        """Output times of the fields in s; one that is not written completely is left out."""
        return fields.times(self.folder / "fields.vtkhdf")

    def fields(self, time: float | None = None, nearest: bool = False) -> pyvista.UnstructuredGrid:
        """The undeformed mesh (m) with its fields at an output time in s, or at the nearest one; by default at the last.

        `user_dict` has the `time` and the `units`. Tensors are xx yy zz xy yz xz.
        """
        return fields.grid(self.folder / "fields.vtkhdf", time, nearest)

    def quantity(self, name: str) -> float:
        """A number by its name in `[check]`, in SI units: `max_von_mises`, `history.COLUMN`, `probe.NAME.max.COLUMN`, .."""
        word, _, rest = name.partition(".")
        if word not in TABLES:
            return self._of_summary(name)
        of, side, column = _parts(word, rest)
        table = self.columns("history") if word == "history" else self.columns(f"{word}s", of)
        if column not in table:
            raise Error(f"{name}: no column {column}; there are {', '.join(table)}")
        values = table[column]
        if word == "profile":
            values = [value for value, time in zip(values, table["time"], strict=True) if time == table["time"][-1]]
        if not values:
            raise NoResults(f"{name}: the table has no rows yet")
        if word != "profile" and side in over_time.NUMBERS:
            number = over_time.NUMBERS[side](table["time"], values)
            if number is None:
                raise NoResults(f"{name}: the values have no {side}")
            return number
        ends = {"": values[-1], "first": values[0], "max": max(values), "min": min(values)}
        if side not in ends:
            raise Error(f"{name}: {side} is no extremum; write history.COLUMN, history.max.COLUMN or history.min.COLUMN")
        return float(ends[side])

    def _of_summary(self, name: str) -> float:
        found: Any = self.summary
        for part in name.split("."):
            found = found.get(part) if isinstance(found, Mapping) else None
        if isinstance(found, bool) or not isinstance(found, (int, float)):
            raise Error(f"summary.json has no number {name}")
        return float(found)

    def check(self) -> list[Check]:
        """Compares the run with the expected results of its job, the table `[check]`."""
        return [self._checked(name, expected) for name, expected in self.job.get("check", {}).items()]

    def _checked(self, name: str, expected: Mapping[str, Any]) -> Check:
        try:
            value = self.quantity(name)
        except NoResults as error:
            return Check(name, expected["value"], math.nan, False, str(error))
        if any(isinstance(number, str) for number in expected.values()):
            return Check(name, expected["value"], value, None, "a formula of parameters, which only the program evaluates")
        off = abs(value - expected["value"])
        relative, absolute = expected.get("relative", math.inf), expected.get("absolute", math.inf)
        passed = off <= absolute and (relative == math.inf or off <= relative * abs(expected["value"]))
        return Check(name, expected["value"], value, passed)

    def report(
        self,
        other: Results | None = None,
        *,
        cells: bool = False,
        contours: bool = False,
        solver: str | os.PathLike[str] | None = None,
    ) -> Path:
        """Writes the page of `solver report`, of this run or beside another one, and returns its path."""
        options = ["--cells"] * cells + ["--contours"] * contours
        folders = [str(self.folder)] + ([str(other.folder)] if other else [])
        program.start([program.find(solver), "report", *options, "--", *folders]).refuse(self.folder)
        return self.folder / "report" / ("comparison.html" if other else "index.html")


def _parts(word: str, rest: str) -> tuple[str, str, str]:
    """Name, side and column of a quantity of a table: `tip`, `max` and `velocity_x` of `probe.tip.max.velocity_x`."""
    before, _, column = rest.rpartition(".")
    if not TABLES[word]:
        return "", before, column
    of, dot, side = before.rpartition(".")
    is_side = dot and side in ("max", "min", "first", *over_time.NUMBERS)
    return (of, side, column) if is_side else (before, "", column)


def _is_locked(path: Path) -> bool:
    """Whether a run holds the lock of its log."""
    try:
        file = os.open(path, os.O_RDONLY)
    except OSError:
        return False
    try:
        fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
        return False
    except BlockingIOError:
        return True
    except OSError:
        # A file system without locks.
        return False
    finally:
        os.close(file)

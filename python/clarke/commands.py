"""The commands of the program: run, check, describe."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeAlias

from . import jobs, program
from .errors import Error
from .results import Results

PathLike: TypeAlias = str | os.PathLike[str]
JobLike: TypeAlias = Mapping[str, Any] | PathLike


def run(
    job: JobLike,
    *,
    ranks: int = 1,
    set: Mapping[str, Any] | None = None,
    folder: PathLike | None = None,
    restart: bool | PathLike = False,
    force: bool = False,
    quiet: bool = False,
    solver: PathLike | None = None,
    launcher: str = "mpirun",
) -> Results:
    """Runs a job, a file or a dictionary of keys, and returns its results.

    `set` changes keys, as in `{"time.step": 1e-3, "contact.0.quadrature": "gauss"}`. `folder` is the output folder, relative to the
    current folder; by default it is that of the job. `restart=True` continues from the newest checkpoint there, or from the checkpoint
    of this path; `force` overwrites other results. `launcher` starts the ranks, for example `srun`. The program's lines appear as it
    writes them, with `quiet` its errors only. A run that does not complete raises `Refused`, `Failed`, `Stopped` or `InternalFault`
    with its message.
    """
    changes = dict(set or {})
    target = _target(job, changes, folder)
    if target is not None:
        changes["output.folder"] = target
    command = program.on_ranks(ranks, program.find(solver), launcher)
    with jobs.as_file(job) as file:
        arguments = ["run", *_sets(changes), *["--force"] * force, *["--quiet"] * quiet]
        if restart is not False:
            arguments.append("--restart" if restart is True else f"--restart={os.fspath(restart)}")
        program.start([*command, *arguments, "--", str(file)], ranks=ranks).refuse(target)
    if target is None:
        raise Error("the run has completed, but not told where its results are")
    return Results(target)


def _target(job: JobLike, changes: Mapping[str, Any], folder: PathLike | None) -> Path | None:
    if folder is not None and "output.folder" in changes:
        raise Error('give the folder once: as folder=, or in set= as "output.folder"')
    target = Path(folder) if folder is not None else jobs.output_folder(job, changes)
    if target is None and isinstance(job, Mapping):
        raise Error("a job without a file and without [output] folder needs folder=")
    return None if target is None else target.absolute()


def _sets(changes: Mapping[str, Any]) -> list[str]:
    return [word for change in jobs.overrides(changes) for word in ("--set", change)]


def validate(
    job: JobLike,
    *,
    ranks: int = 1,
    set: Mapping[str, Any] | None = None,
    solver: PathLike | None = None,
    launcher: str = "mpirun",
) -> dict[str, Any]:
    """Checks a job without running it: effects, sizes, certificates, memory (B) and time (s), as `solver check --json` prints them.

    A job that cannot run raises `Refused` with the faults and their places.
    """
    changes = dict(set or {})
    target = jobs.output_folder(job, changes)
    if target is not None:
        changes["output.folder"] = target.absolute()
    command = program.on_ranks(ranks, program.find(solver), launcher)
    with jobs.as_file(job) as file:
        ended = program.start([*command, "check", "--json", *_sets(changes), "--", str(file)], show=False, ranks=ranks)
    ended.refuse()
    found = json.loads(ended.output)
    assert isinstance(found, dict)
    return found


def describe(*names: str, study: bool = False, solver: PathLike | None = None) -> str:
    """What the program says about keys of a job, or of a study: meaning, unit, range and default. `print` it."""
    words = ["study"] * study + list(names)
    ended = program.start([program.find(solver), "describe", "--", *words], show=False)
    ended.refuse()
    return ended.output

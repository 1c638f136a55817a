"""What can go wrong, each with what to do about it in its message."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path


class Error(Exception):
    """Any error of this package."""


class SolverMissing(Error):
    """The program `solver`, or the launcher of its ranks, was not found."""


class PackageMissing(Error, ImportError):
    """An optional Python package is not installed."""


class NoResults(Error):
    """A folder, or a table in it, that no run has written."""


class Unfinished(Error):
    """The run is still going on, or was killed, and has not written this yet."""


class Damaged(Error):
    """A file that cannot be read as what it should be."""


class RunError(Error):
    """The program ended with another exit code than 0; the text of the error is the program's own message.

    `code` is the exit code, `command` what was started, `folder` the output folder, if it is known.
    """

    def __init__(self, message: str, code: int, command: Sequence[str], folder: Path | None = None) -> None:
        super().__init__(message)
        self.code = code
        self.command = list(command)
        self.folder = folder


class Failed(RunError):
    """The run failed (exit code 1); its last state was saved if it is finite."""


class Refused(RunError):
    """The job, the mesh or the command line was refused (exit code 2); nothing was written."""


class Stopped(RunError):
    """The run stopped on request (exit code 3) with a checkpoint: `restart=True` continues it."""


class InternalFault(RunError):
    """A fault of the solver or of a library (exit code 4), or the end of the program by a signal."""


def of_code(code: int) -> type[RunError]:
    """The class of an exit code, as in the table of exit codes in docs/reference-outputs.md."""
    return {1: Failed, 2: Refused, 3: Stopped}.get(code, InternalFault)

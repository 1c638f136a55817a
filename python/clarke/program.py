"""The program `solver`: where it is, and how it is started."""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

from .errors import SolverMissing, of_code

BUILT = Path("target/release/solver")
# What mpirun adds to the error of a rank: a text between two lines of dashes, and lines about signals.
OF_LAUNCHER = re.compile(r"^-{60,}\n.*?^-{60,}\n?|^mpirun: Forwarding signal [^\n]*\n", re.MULTILINE | re.DOTALL)


def find(solver: str | os.PathLike[str] | None = None) -> str:
    """The path of the program: the argument, `CLARKE_SOLVER`, `solver` on the PATH, or `target/release/solver` in the current folder,
    in that of this package, or in one above them."""
    for origin, given in (("solver=", solver), ("CLARKE_SOLVER=", os.environ.get("CLARKE_SOLVER"))):
        if given:
            found = shutil.which(given)
            if found is None:
                raise SolverMissing(f"{origin}{os.fspath(given)} is not a program")
            return os.path.abspath(found)
    on_path = shutil.which("solver")
    if on_path is not None:
        return os.path.abspath(on_path)
    for start in (Path.cwd(), Path(__file__).resolve().parent):
        for folder in (start, *start.parents):
            if os.access(folder / BUILT, os.X_OK):
                return str(folder / BUILT)
    raise SolverMissing(
        "the program `solver` was not found: compile it with `make build`, and give its path as solver=, in the variable CLARKE_SOLVER "
        "or on the PATH"
    )


@dataclass
class Ended:
    """A program that has ended: exit code and texts."""

    command: list[str]
    code: int
    output: str
    errors: str

    def refuse(self, folder: Path | None = None, accepted: Sequence[int] = (0,)) -> None:
        """Raises the error of the exit code, with the program's own message, unless it is one of the accepted codes."""
        if self.code in accepted:
            return
        said = OF_LAUNCHER.sub("", self.errors).strip() or (self.errors.strip() if self.code != 3 else "")
        if self.code == 3 and folder is not None:
            said = f"{said}\n{_reason_of_stop(folder / 'run.log')}".strip()
        if self.code < 0:
            said = f"{said}\nended by {signal.Signals(-self.code).name}".strip()
        said = said or f"exit code {self.code}, without a message; the last lines:\n{self.output[-500:]}"
        raise of_code(self.code)(said, self.code, self.command, folder)


def _reason_of_stop(log: Path) -> str:
    """The last line about it in the log of a run, which the program prints on its standard output."""
    try:
        lines = log.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return ""
    return next((line for line in reversed(lines) if line.startswith("stopping")), "")


def start(command: Sequence[str], show: bool = True, ranks: int = 1) -> Ended:
    """Starts a program without a shell and waits for it.

    Its lines appear as they come on `sys.stdout` and `sys.stderr`, also in notebooks; with `show=False` they are only kept. An interrupt
    (Ctrl-C) asks a run to save its state and to stop, a second one kills it.
    """
    with tempfile.TemporaryDirectory(prefix="clarke-") as own:
        # Ranks that no launcher has started would share a folder of Open MPI with all others of the user, and remove its files.
        environment = os.environ | ({"OMPI_MCA_orte_tmpdir_base": own} if ranks == 1 else {})
        try:
            process = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                text=True,
                encoding="utf-8",
                errors="replace",
                process_group=0,
                env=environment,
            )
        except OSError as error:
            raise SolverMissing(f"cannot start {command[0]}: {error.strerror}") from error
        output, errors = _Copy(process.stdout, sys.stdout, show), _Copy(process.stderr, sys.stderr, show)
        code = _wait(process)
        return Ended(list(command), code, output.text(), errors.text())


def _wait(process: subprocess.Popen[str]) -> int:
    """The exit code; after an interrupt that the program did not follow with one of its own, `KeyboardInterrupt`."""
    interrupts = 0
    while True:
        try:
            code = process.wait()
        except KeyboardInterrupt:
            interrupts += 1
            if interrupts == 1:
                process.send_signal(signal.SIGUSR1)
            else:
                os.killpg(process.pid, signal.SIGKILL)
        except BaseException:
            os.killpg(process.pid, signal.SIGKILL)
            raise
        else:
            break
    if interrupts and code not in range(4):
        raise KeyboardInterrupt
    return code


class _Copy:
    """A thread that keeps the lines of a pipe, and shows them."""

    def __init__(self, pipe: IO[str] | None, shown: Any, show: bool) -> None:
        assert pipe is not None
        self._lines: list[str] = []
        self._thread = threading.Thread(target=self._copy, args=(pipe, shown if show else None), daemon=True)
        self._thread.start()

    def _copy(self, pipe: IO[str], shown: Any) -> None:
        with pipe:
            for line in pipe:
                self._lines.append(line)
                if shown is not None:
                    shown.write(line)
                    shown.flush()

    def text(self) -> str:
        self._thread.join()
        return "".join(self._lines)


def on_ranks(ranks: int, solver: str, launcher: str) -> list[str]:
    """The command of the program on some ranks, to which its arguments are added."""
    if ranks < 1:
        raise ValueError(f"ranks={ranks}: at least 1")
    if ranks == 1:
        return [solver]
    if shutil.which(launcher) is None:
        raise SolverMissing(f"{launcher}, which starts the program on {ranks} ranks, was not found: install MPI, or give launcher=")
    return [launcher, "-n", str(ranks), solver]

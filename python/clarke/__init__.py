"""Runs jobs of Clarke and reads what the program writes. All quantities are in SI units.

    run = clarke.run("job.toml", ranks=2, set={"time.step": 1e-3}, folder="out")
    run = clarke.open("out")
    run.history, run.resultants, run.contacts, run.probes, run.profiles      # pandas
    run.columns("history")["time"]                                           # plain lists
    run.summary, run.check(), run.report()
    run.fields(0.5)                                                          # pyvista
    clarke.sweep("job.toml", {"time.step": [1e-3, 5e-4]}, ["max_von_mises"], folder="out/sweep")
    clarke.validate("job.toml"); print(clarke.describe("friction"))

Only the standard library is needed, pandas for tables, h5py and pyvista for fields.
"""

from .commands import describe, run, validate
from .errors import (
    Damaged,
    Error,
    Failed,
    InternalFault,
    NoResults,
    PackageMissing,
    Refused,
    RunError,
    SolverMissing,
    Stopped,
    Unfinished,
)
from .jobs import Job, dumps, load
from .results import Check, Results, open
from .sweeps import Sweep, open_sweep, sweep
from .tables import Table

__all__ = [
    "Check",
    "Damaged",
    "Error",
    "Failed",
    "InternalFault",
    "Job",
    "NoResults",
    "PackageMissing",
    "Refused",
    "Results",
    "RunError",
    "SolverMissing",
    "Stopped",
    "Sweep",
    "Table",
    "Unfinished",
    "describe",
    "dumps",
    "load",
    "open",
    "open_sweep",
    "run",
    "sweep",
    "validate",
]

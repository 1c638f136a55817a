"""A small job of which the results are known by hand, and a run of it for all tests of a process."""

from __future__ import annotations

import copy
import functools
import importlib.util
import os
import tempfile
import unittest
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import clarke

Test = TypeVar("Test")
ROOT = Path(__file__).resolve().parents[2]
WORK = tempfile.TemporaryDirectory(prefix="clarke-")
# A block that slides to a stop: 40 kg/m, 1 m/s, coefficient 0.5 (jobs/sliding_block.toml).
SLIDING_BLOCK: dict[str, Any] = {
    "mesh": {"rectangle": {"size": [0.4, 0.1], "cells": [8, 2]}},
    "material": {
        "hypothesis": "plane_strain",
        "density": 1000.0,
        "viscosity": {"volumetric": 1e6, "shear": 1e6},
    },
    "body_force": [{"value": [0.0, -9810.0]}],
    "contact": [{"on": ["bottom"], "normal": {"unilateral": {}}, "friction": {"coulomb": {"coefficient": 0.5}}}],
    "initial": {"velocity": [1.0, 0.0]},
    "time": {"end": 0.25, "step": 0.001},
    "output": {
        "fields": {"every": 100},
        "probe": [
            {"name": "centre", "point": [0.2, 0.05]},
            {"name": "foot", "point": [0.0, 0.0]},
            {"name": "first", "point": [0.4, 0.0]},
        ],
        "profile": [{"on": "bottom"}],
    },
    "check": {
        "probe.centre.displacement_x": {"value": 0.10144, "relative": 1e-3},
        "max_energy_imbalance": {"value": 0.0, "absolute": 1e-9},
    },
}
# Ranks that wait for each other leave the cores to other tests, and launchers do not share a folder with those of other programs.
os.environ.setdefault("OMPI_MCA_mpi_yield_when_idle", "1")
os.environ["OMPI_MCA_orte_tmpdir_base"] = WORK.name


def sliding_block(**tables: Any) -> dict[str, Any]:
    """A copy of the job with other tables."""
    return copy.deepcopy(SLIDING_BLOCK) | tables


def folder() -> Path:
    """A new folder."""
    return Path(tempfile.mkdtemp(dir=WORK.name))


@functools.cache
def finished() -> clarke.Results:
    """A run of the job on two ranks, which tests only read."""
    return clarke.run(sliding_block(), ranks=2, folder=folder() / "out", quiet=True)


def needs(*packages: str) -> Callable[[Test], Test]:
    """Skips a test without these optional packages, and says so."""
    missing = [package for package in packages if importlib.util.find_spec(package) is None]
    reason = f"optional: pip install {' '.join(missing)}"
    return lambda test: unittest.skipIf(bool(missing), reason)(test)  # type: ignore[type-var]


def script(path: Path, *lines: str) -> Path:
    """An executable script, in place of a program."""
    path.write_text("\n".join(["#!/bin/sh", *lines, ""]))
    path.chmod(0o755)
    return path

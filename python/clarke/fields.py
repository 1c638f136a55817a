"""The fields of a run, from `fields.vtkhdf`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from . import declared
from .errors import Damaged, Error, NoResults, PackageMissing

if TYPE_CHECKING:
    import pyvista


def times(path: Path) -> list[float]:
    """The output times in s that are written completely."""
    with _opened(path) as file:
        return _times(file)


def grid(path: Path, time: float | None, nearest: bool) -> pyvista.UnstructuredGrid:
    """The mesh with its fields at an output time in s, by default the last one."""
    try:
        import numpy
        import pyvista
    except ImportError as error:
        raise PackageMissing("fields need pyvista: pip install pyvista h5py") from error
    with _opened(path) as file:
        step = _step(_times(file), time, nearest, path)
        mesh = file["VTKHDF"]
        nodes = mesh["Connectivity"][:]
        starts = mesh["Offsets"][:]
        cells = numpy.insert(nodes, starts[:-1], numpy.diff(starts))
        made = pyvista.UnstructuredGrid(cells, mesh["Types"][:], mesh["Points"][:])
        for place, data, count in (
            ("PointData", made.point_data, len(mesh["Points"])),
            ("CellData", made.cell_data, len(mesh["Types"])),
        ):
            starts_of = mesh["Steps"].get(f"{place}Offsets", {})
            for name, values in mesh[place].items():
                first = int(starts_of[name][step]) if name in starts_of else 0
                data[name] = values[first : first + count]
        made.user_dict["time"] = _times(file)[step]
    made.user_dict["units"] = {
        name: declared.unit("fields.vtkhdf", name, False) for name in (*made.point_data, *made.cell_data)
    }
    return made


def _opened(path: Path) -> Any:
    try:
        import h5py
    except ImportError as error:
        raise PackageMissing("fields need h5py: pip install h5py") from error
    if not path.exists():
        raise NoResults(f"{path} is not there: the run has written no fields yet")
    try:
        # A lock would disturb the run that writes into the file.
        return _Opened(h5py.File(path, "r", locking=False), path)
    except OSError as error:
        raise _damaged(path, error) from error


class _Opened:
    """A file whose faults are told as such."""

    def __init__(self, file: Any, path: Path) -> None:
        self._file, self._path = file, path

    def __enter__(self) -> Any:
        return self._file

    def __exit__(self, kind: Any, error: Any, trace: Any) -> None:
        self._file.close()
        if isinstance(error, (OSError, KeyError, RuntimeError, IndexError, ValueError)):
            raise _damaged(self._path, error) from error


def _damaged(path: Path, error: BaseException) -> Damaged:
    return Damaged(f"{path} cannot be read: {error}; if the run is writing into it, try again, otherwise it is damaged")


def _times(file: Any) -> list[float]:
    steps = file["VTKHDF/Steps"]
    return [float(time) for time in steps["Values"][: int(steps.attrs["NSteps"])]]


def _step(known: list[float], time: float | None, nearest: bool, path: Path) -> int:
    if not known:
        raise NoResults(f"{path} has no complete output time yet")
    if time is None:
        return len(known) - 1
    step = min(range(len(known)), key=lambda at: abs(known[at] - time))
    if not nearest and abs(known[step] - time) > 1e-9 * max(abs(time), abs(known[step])):
        raise Error(f"no fields at {time} s; the nearest output time is {known[step]} s: nearest=True takes it, .times lists all")
    return step

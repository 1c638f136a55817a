"""The CSV files of a run as plain columns with units."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from . import declared
from .errors import Damaged, NoResults, PackageMissing

if TYPE_CHECKING:
    import pandas

# Columns of words; all others are numbers.
WORDS = ("source", "probe", "profile")
# Before names that begin so, the program writes an apostrophe, for spreadsheets.
GUARDED = ("=", "+", "-", "@", "'")


class Table(Mapping[str, list[Any]]):
    """Columns by name: numbers, `nan` where the column does not apply to the row, or words. `units` has the unit of each."""

    def __init__(self, columns: dict[str, list[Any]], units: dict[str, str]) -> None:
        self._columns = columns
        self.units = units

    def __getitem__(self, name: str) -> list[Any]:
        try:
            return self._columns[name]
        except KeyError:
            raise KeyError(f"no column {name}; there are {', '.join(self._columns)}") from None

    def __iter__(self) -> Iterator[str]:
        return iter(self._columns)

    def __len__(self) -> int:
        return len(self._columns)

    @property
    def rows(self) -> int:
        """Number of rows."""
        return len(next(iter(self._columns.values()), []))

    def where(self, **wanted: Any) -> Table:
        """The rows in which columns have these values, as in `where(probe="centre")`."""
        kept = [row for row in range(self.rows) if all(self[name][row] == value for name, value in wanted.items())]
        columns = {name: [column[row] for row in kept] for name, column in self._columns.items()}
        return Table(columns, self.units)

    def frame(self) -> pandas.DataFrame:
        """The table for pandas, with the units in `attrs["units"]`."""
        try:
            import pandas
        except ImportError as error:
            raise PackageMissing(
                "tables need pandas: pip install pandas; without it, `.columns(..)` gives plain lists"
            ) from error
        frame = pandas.DataFrame(self._columns)
        frame.attrs["units"] = dict(self.units)
        return frame


def read(path: Path, is_plane: bool) -> Table:
    """Reads a table of a run, without a last row that is not written to its end."""
    header, rows = records(path)
    columns: dict[str, list[Any]] = {}
    for at, name in enumerate(header):
        entries = [row[at] for _, row in rows]
        try:
            columns[name] = _column(name, entries)
        except ValueError:
            raise _not_a_number(path, name, [(line, row[at]) for line, row in rows]) from None
    return Table(columns, {name: declared.unit(path.name, name, is_plane) for name in header})


def records(path: Path) -> tuple[list[str], list[tuple[int, list[str]]]]:
    """The names of the columns, and the rows with their lines; a run may be writing the last one."""
    try:
        text = path.read_text(encoding="utf-8", errors="replace")
    except FileNotFoundError:
        raise NoResults(f"{path} is not there") from None
    whole = text[: text.rfind("\n") + 1]
    reader = csv.reader(io.StringIO(whole, newline=""))
    header = next(reader, None)
    if header is None:
        raise NoResults(f"{path} has no rows yet")
    try:
        rows = [(reader.line_num, row) for row in reader]
    except csv.Error as error:
        raise Damaged(f"{path}, line {reader.line_num}: {error}; the file is damaged") from error
    for line, row in rows:
        if len(row) != len(header):
            raise Damaged(f"{path}, line {line}: {len(row)} entries for {len(header)} columns; the file is damaged")
    return header, rows


def unguarded(entry: str) -> str:
    """A name without the apostrophe for spreadsheets."""
    return entry[1:] if entry.startswith("'") and entry[1:].startswith(GUARDED) else entry


def _column(name: str, entries: list[str]) -> list[Any]:
    if name in WORDS:
        return [unguarded(entry) for entry in entries]
    if name == "step":
        return [int(entry) for entry in entries]
    return [float(entry) if entry else math.nan for entry in entries]


def _not_a_number(path: Path, name: str, entries: list[tuple[int, str]]) -> Damaged:
    for line, entry in entries:
        try:
            _column(name, [entry])
        except ValueError:
            return Damaged(f"{path}, line {line}: {name} is no number: {entry!r}; the file is damaged")
    return Damaged(f"{path} is damaged")

"""Units of columns, fields and numbers, as the program's page of output files (docs/reference-outputs.md) declares them.

The tests of the program compare that page with the columns that it writes; there is no second list here.
"""

from __future__ import annotations

import functools
from pathlib import Path

PAGE = Path(__file__).with_name("reference-outputs.md")
# "In plane problems forces, moments and energies are per metre of thickness", and areas are lengths.
IN_PLANE = {"N": "N/m", "N m": "N", "J": "J/m", "m²": "m"}


@functools.cache
def units(section: str) -> dict[str, str]:
    """The unit of each name in the tables of a section, such as `history.csv`, `Fields` or `summary.json`; empty without unit."""
    found: dict[str, str] = {}
    heading: list[str] = []
    for line in _section(section).splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if line.startswith("| `") and len(cells) == len(heading) and "unit" in heading:
            names = cells[0].split("`")[1::2]
            entry = cells[heading.index("unit")]
            several = [unit.strip() for unit in entry.split(",")]
            matched = several if len(several) == len(names) else [entry] * len(names)
            found.update(zip(names, matched, strict=True))
        elif line.startswith("|") and not line.startswith("|--"):
            heading = cells
    return found


def unit(section: str, name: str, is_plane: bool) -> str:
    """The unit of a name; that of 1 is empty, and so is that of a name that is not on the page."""
    found = units(section).get(name, "")
    found = "" if found == "1" else found
    return IN_PLANE.get(found, found) if is_plane and section.endswith(".csv") else found


def _section(title: str) -> str:
    text = PAGE.read_text(encoding="utf-8")
    for part in text.split("\n## ")[1:]:
        if part.splitlines()[0].strip("` ") == title:
            return part
    return ""

"""Units of columns, fields and numbers, as the program declares them (`solver describe outputs --json`)."""

from __future__ import annotations

import functools
import json
from pathlib import Path

FILE = Path(__file__).with_name("outputs.json")


@functools.cache
def units(file: str) -> dict[str, tuple[str, str]]:
    """The unit of each name in a file, such as `history.csv`, `fields.vtkhdf` or `summary.json`, in the plane and in space."""
    for declared in json.loads(FILE.read_text(encoding="utf-8"))["files"]:
        if declared["file"] == file:
            names = declared.get("columns") or declared.get("fields") or declared["members"]
            return {name["name"]: (name["unit_in_plane"], name["unit"]) for name in names}
    return {}


def unit(file: str, name: str, is_plane: bool) -> str:
    """The unit of a name; empty for a number without one, and for a name that is not declared."""
    return units(file).get(name, ("", ""))[0 if is_plane else 1]


def unit_of_member(name: str, is_plane: bool) -> str:
    """The unit of a number of `summary.json`, such as `wall_seconds.total`, whose name or position in its member depends on the run."""
    found = unit("summary.json", name, is_plane)
    member, _, part = name.rpartition(".")
    if found or not member:
        return found
    several = unit("summary.json", member, is_plane).split(", ")
    return several[int(part) if part.isdigit() and int(part) < len(several) else 0]

"""Jobs as dictionaries: read from TOML, varied in Python, written as TOML."""

from __future__ import annotations

import contextlib
import json
import math
import os
import re
import tempfile
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from .errors import Error

BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")


class Job(dict[str, Any]):
    """The keys of a job. `folder` is the folder to which its paths are relative, `name` that of its file."""

    def __init__(self, keys: Mapping[str, Any], folder: str | os.PathLike[str] = ".", name: str = "") -> None:
        super().__init__(keys)
        self.folder = Path(folder)
        self.name = name


def load(path: str | os.PathLike[str]) -> Job:
    """Reads a job or study file; it is checked by `clarke.validate` and by runs, not here."""
    path = Path(path)
    try:
        with path.open("rb") as file:
            return Job(tomllib.load(file), path.parent, path.stem)
    except OSError as error:
        raise Error(f"cannot read {path}: {error.strerror}") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise Error(f"{path} is no TOML: {error}") from error


def dumps(keys: Mapping[str, Any]) -> str:
    """The keys as TOML, which `tomllib` reads as the same keys."""
    lines: list[str] = []
    _write_table(lines, keys, ())
    return "\n".join(lines) + "\n"


def _write_table(lines: list[str], table: Mapping[str, Any], path: tuple[str, ...]) -> None:
    later: list[tuple[str, Any]] = []
    for key, value in table.items():
        if not isinstance(key, str):
            raise Error(f"the key {key!r} in [{'.'.join(path)}] is no text")
        value = _plain(value)
        if isinstance(value, Mapping) or _is_list_of_tables(value):
            later.append((key, value))
        else:
            lines.append(f"{_key(key)} = {_value(value, (*path, key))}")
    for key, value in later:
        name = ".".join(map(_key, (*path, key)))
        for entry in [value] if isinstance(value, Mapping) else value:
            lines.extend(["", f"[{name}]" if isinstance(value, Mapping) else f"[[{name}]]"])
            _write_table(lines, entry, (*path, key))


def _is_list_of_tables(value: Any) -> bool:
    return isinstance(value, Sequence) and len(value) > 0 and all(isinstance(entry, Mapping) for entry in value)


def _key(key: str) -> str:
    return key if BARE_KEY.fullmatch(key) else _text(key)


def _text(text: str) -> str:
    # What JSON leaves as it is and TOML does not allow.
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def _plain(value: Any) -> Any:
    """Paths, and numbers and arrays of numpy, as plain values."""
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    return value.tolist() if hasattr(value, "tolist") else value


def _value(value: Any, path: Sequence[str] = ()) -> str:
    value = _plain(value)
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, int):
        return str(value)
    if isinstance(value, float):
        return repr(value) if math.isfinite(value) else str(value)
    if isinstance(value, Mapping):
        entries = (f"{_key(key)} = {_value(entry, (*path, key))}" for key, entry in value.items())
        return "{ " + ", ".join(entries) + " }" if value else "{}"
    if isinstance(value, Sequence):
        return "[" + ", ".join(_value(entry, path) for entry in value) + "]"
    advice = "leave the key out" if value is None else "use text, numbers, true or false, lists and dictionaries"
    raise Error(f"{'.'.join(path) or 'a key'}: a job has no place for {value!r}; {advice}")


def overrides(keys: Mapping[str, Any]) -> list[str]:
    """Keys such as `{"time.step": 1e-3}` as the program takes them: `["time.step=0.001"]`."""
    return [f"{key}={_value(value, (key,))}" for key, value in keys.items()]


@contextlib.contextmanager
def as_file(job: Mapping[str, Any] | str | os.PathLike[str]) -> Iterator[Path]:
    """The file of a job; that of a dictionary exists only as long as the context, in the folder of its paths."""
    if not isinstance(job, Mapping):
        yield Path(job)
        return
    folder = getattr(job, "folder", Path())
    try:
        file = tempfile.NamedTemporaryFile("w", dir=folder, prefix=".job-", suffix=".toml", encoding="utf-8")
    except OSError as error:
        raise Error(
            f"cannot write the job into {folder}, to which its paths are relative ({error.strerror}); "
            "give clarke.Job another folder, and its paths in full"
        ) from error
    with file:
        file.write(dumps(job))
        file.flush()
        yield Path(file.name)


def output_folder(job: Mapping[str, Any] | str | os.PathLike[str], changes: Mapping[str, Any]) -> Path | None:
    """Where the program puts results: `[output] folder`, else `out/NAME` beside the job; `None` if it cannot be told."""
    if not isinstance(job, Mapping):
        try:
            job = load(job)
        except Error:
            return None
    beside, name = getattr(job, "folder", Path()), getattr(job, "name", "")
    output = job.get("output", {})
    folder = output.get("folder") if isinstance(output, Mapping) else None
    folder = changes.get("output.folder", folder)
    if folder is None and name:
        folder = f"out/{name}"
    return None if folder is None else beside / folder

"""The code of docs/python.md, and the examples."""

import contextlib
import io
import os
import re
import struct
import subprocess
import sys
import time
import tomllib
import unittest
from typing import Any

from . import sample

# Names of the optional packages in a block, by what it uses.
OPTIONAL = {"pandas": "history =", "pyvista": "fields("}


def block(page: str, language: str) -> list[str]:
    """The fenced blocks of a page in a language."""
    text = (sample.ROOT / page).read_text(encoding="utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)


class Page(unittest.TestCase):
    def setUp(self) -> None:
        self.addCleanup(os.chdir, os.getcwd())
        os.chdir(sample.folder())
        with open("first_job.toml", "w", encoding="utf-8") as file:
            file.write(block("README.md", "toml")[0])

    def execute(self, blocks: list[str]) -> dict[str, Any]:
        names: dict[str, Any] = {}
        with contextlib.redirect_stdout(io.StringIO()) as shown:
            for code in blocks:
                exec(compile(code, "docs/python.md", "exec"), names)
        return names | {"shown": shown.getvalue()}

    def test_the_code_of_the_core_runs(self) -> None:
        blocks = [code for code in block("docs/python.md", "python") if not any(use in code for use in OPTIONAL.values())]
        self.assertEqual(len(blocks), 3)
        names = self.execute(blocks)
        table = names["sweep"].columns
        self.assertAlmostEqual(table["probe.centre.displacement_x"][1], 0.10144, delta=1e-4)
        self.assertIn("completed     125 steps", names["shown"])
        self.assertIn("{} completed", names["shown"])

    @sample.needs("pandas", "h5py", "pyvista")
    def test_the_code_with_tables_and_fields_runs(self) -> None:
        blocks = block("docs/python.md", "python")
        self.assertEqual(len(blocks), 4)
        names = self.execute(blocks)
        self.assertIn("J/m\n[0.0, 0.05, 0.1, 0.15, 0.2, 0.25]\n", names["shown"])
        self.assertEqual(names["grid"].user_dict["time"], 0.1)

    def test_the_page_is_short(self) -> None:
        self.assertLessEqual(len((sample.ROOT / "docs/python.md").read_text().split()), 400)


class Version(unittest.TestCase):
    def test_the_package_has_the_version_of_the_program(self) -> None:
        def read(file: str) -> dict[str, Any]:
            return tomllib.loads((sample.ROOT / file).read_text())

        program = read("Cargo.toml")["workspace"]["package"]["version"]
        self.assertEqual(read("python/pyproject.toml")["project"]["version"], program)


class Examples(unittest.TestCase):
    """Each draws its picture and prints a number beside that of its closed form."""

    def example(self, name: str) -> tuple[str, tuple[int, ...]]:
        """What an example prints last, and the width and height of its picture."""
        folder = sample.folder()
        begin = time.monotonic()
        ended = subprocess.run(
            [sys.executable, str(sample.ROOT / f"python/examples/{name}.py"), str(folder)],
            env=os.environ | {"PYTHONPATH": str(sample.ROOT / "python")},
            capture_output=True,
            text=True,
            check=False,
        )
        self.assertEqual(ended.returncode, 0, ended.stderr)
        print(f"{name}: {time.monotonic() - begin:.1f} s")
        picture = (folder / f"{name}.png").read_bytes()
        self.assertEqual(picture[:8], b"\x89PNG\r\n\x1a\n")
        self.assertGreater(len(picture), 10_000, "an empty picture")
        return ended.stdout.splitlines()[-1], struct.unpack(">II", picture[16:24])

    def numbers(self, line: str) -> list[float]:
        return [float(number) for number in re.findall(r"[\d.]+(?:e[+-]?\d+)?", line) if number.strip(".")]

    @sample.needs("pandas", "matplotlib")
    def test_first_run(self) -> None:
        line, size = self.example("first_run")
        self.assertIn("moved 0.10144 m", line)
        self.assertEqual(size, (840, 480))

    @sample.needs("pandas", "matplotlib")
    def test_brake_friction(self) -> None:
        line, _ = self.example("brake_friction")
        force, off, _ = self.numbers(line)
        self.assertEqual(force, 4.5)
        self.assertLess(off, 1e-9)

    @sample.needs("pandas", "matplotlib")
    def test_speed_sweep(self) -> None:
        line, _ = self.example("speed_sweep")
        runs, off = self.numbers(line)[:2]
        self.assertEqual(runs, 25)
        # v k / 2 = 1 m/s * 2.5 ms / 2
        self.assertLessEqual(off, 0.00126)

    @sample.needs("pandas", "matplotlib")
    def test_hertz_pressure(self) -> None:
        line, _ = self.example("hertz_pressure")
        cells, _, pressure, closed = self.numbers(line)
        self.assertEqual((cells, closed), (64, 27.473))
        self.assertAlmostEqual(pressure / closed, 1.0, delta=0.01)

    @sample.needs("h5py", "pyvista")
    def test_stress_field(self) -> None:
        line, size = self.example("stress_field")
        in_field, in_summary = self.numbers(line)
        self.assertEqual(in_field, in_summary)
        self.assertEqual(size, (900, 700))

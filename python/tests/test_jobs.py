"""Jobs as dictionaries and TOML."""

import pathlib
import tomllib
import unittest

import clarke
from clarke import jobs

from . import sample


class Toml(unittest.TestCase):
    def test_every_job_of_the_tree_is_written_as_the_same_keys(self) -> None:
        files = sorted((sample.ROOT / "jobs").rglob("*.toml"))
        files = [file for file in files if "out" not in file.parts]
        self.assertGreater(len(files), 100)
        for file in files:
            with self.subTest(file=file.name):
                keys = clarke.load(file)
                self.assertEqual(tomllib.loads(clarke.dumps(keys)), keys)

    def test_values_are_read_back(self) -> None:
        keys = {
            "text": 'a "b" \\ \n\t\x7f ä {t}',
            "a b": {"c.d": True, "": False},
            "numbers": [1, -2.5e-300, 1e22, float("inf"), 10**18],
            "nested": [[1, 2], [], [{"x": 1}, 3]],
            "tables": [{"a": {"b": {}}, "c": [{"d": 1}, {}]}, {}],
            "empty": [],
        }
        self.assertEqual(tomllib.loads(clarke.dumps(keys)), keys)
        self.assertEqual(jobs.overrides({"a.0.b": "x y", "c": [1, 0.5]}), ['a.0.b="x y"', "c=[1, 0.5]"])
        self.assertEqual(jobs.overrides({"mesh.file": pathlib.Path("m.msh")}), ['mesh.file="m.msh"'])

    def test_what_toml_can_not_hold_is_refused_with_its_key(self) -> None:
        for value, words in [(None, "leave the key out"), (1j, "use text, numbers")]:
            with self.assertRaisesRegex(clarke.Error, f"material.density: .*{words}"):
                clarke.dumps({"material": {"density": value}})
        with self.assertRaisesRegex(clarke.Error, r"key 3 in \[time\]"):
            clarke.dumps({"time": {3: 1}})

    def test_files_that_are_no_jobs_are_refused(self) -> None:
        folder = sample.folder()
        with self.assertRaisesRegex(clarke.Error, "cannot read .*No such file"):
            clarke.load(folder / "job.toml")
        (folder / "job.toml").write_text("a = [")
        with self.assertRaisesRegex(clarke.Error, "is no TOML"):
            clarke.load(folder / "job.toml")

    @sample.needs("numpy")
    def test_numbers_of_numpy_are_numbers(self) -> None:
        import numpy

        self.assertEqual(jobs.overrides({"a": numpy.float64(0.5), "b": numpy.arange(2)}), ["a=0.5", "b=[0, 1]"])

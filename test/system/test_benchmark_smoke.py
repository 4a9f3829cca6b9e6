#!/usr/bin/python3
"""benchmark.py with the real programs, on ten seconds of one scenario.

usage: test_benchmark_smoke.py BIN_DIR SOURCE_DIR
"""
import json
import pathlib
import subprocess
import sys
import tempfile
import unittest

BIN = pathlib.Path()
SOURCE = pathlib.Path()


class Smoke(unittest.TestCase):
    def test_a_short_cell_is_measured(self):
        with tempfile.TemporaryDirectory() as folder:
            done = subprocess.run(
                ["/usr/bin/python3", SOURCE / "scripts/benchmark.py", "--bin", BIN, "--output", folder, "--scenarios",
                 "street", "--seeds", "11", "--duration", "10"], capture_output=True, text=True, check=False)
            self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
            results = json.loads(pathlib.Path(folder, "results.json").read_text(encoding="utf-8"))
        cell, = results["cells"]
        self.assertGreater(cell["path_m"], 20.0)
        self.assertLess(cell["ate_rmse_m"], 0.1)
        self.assertGreater(cell["covered_share"], 0.95)
        self.assertGreater(cell["real_time_factor"], 0.0)
        self.assertGreater(cell["stages_ms"]["mapping"], 0.0)


if __name__ == "__main__":
    SOURCE = pathlib.Path(sys.argv.pop()).resolve()
    BIN = pathlib.Path(sys.argv.pop()).resolve()
    unittest.main(verbosity=2)

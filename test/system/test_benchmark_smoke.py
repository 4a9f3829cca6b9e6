#!/usr/bin/python3
"""benchmark.py with the real programs, on its short subset.

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
    def test_the_short_subset_is_measured_and_good(self):
        with tempfile.TemporaryDirectory() as folder:
            done = subprocess.run(
                ["/usr/bin/python3", SOURCE / "scripts/benchmark.py", "--bin", BIN, "--output", folder, "--short"],
                capture_output=True, text=True, check=False)
            self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
            results = json.loads(pathlib.Path(folder, "results.json").read_text(encoding="utf-8"))
        self.assertEqual({cell["scenario"] for cell in results["cells"]}, {"street", "tunnel", "corridor", "plaza"})
        for cell in results["cells"]:
            with self.subTest(cell["scenario"]):
                self.assertGreater(cell["path_m"], 15.0)
                # A thousandth of the way, or what centimetres of noise do on a short one.
                self.assertLess(cell["ate_rmse_m"], max(0.05, 1e-3 * cell["path_m"]))
                self.assertGreater(cell["covered_share"], 0.95)
                self.assertGreater(cell["real_time_factor"], 0.0)
                self.assertGreater(cell["stages_ms"]["mapping"], 0.0)


if __name__ == "__main__":
    SOURCE = pathlib.Path(sys.argv.pop()).resolve()
    BIN = pathlib.Path(sys.argv.pop()).resolve()
    unittest.main(verbosity=2)

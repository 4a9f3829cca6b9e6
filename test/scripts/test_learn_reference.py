"""learn_reference.py: shares of the bins, and a file that the configuration can include."""

import numpy as np
import pytest

from fdi_lio_scripts.reference_learning import histogram, learn

HEADER = "stamp,fdi,structural,sparse,dynamic"


def write_run(folder, structural):
    """A run with given values of the structural sub-factor, sparse 0.05 and dynamic 0.95."""
    folder.mkdir()
    rows = [f"{i},0.5,{value},0.05,0.95" for i, value in enumerate(structural)]
    (folder / "degeneracy.csv").write_text("\n".join([HEADER] + rows) + "\n")
    return folder


def test_histogram_has_the_closed_form():
    np.testing.assert_allclose(histogram(np.array([0.0, 0.49, 1.0, 0.2]), 2), [3.5 / 5, 1.5 / 5])


def test_runs_count_equally_however_long(tmp_path):
    long, short = write_run(tmp_path / "a", [0.1] * 900), write_run(tmp_path / "b", [0.9] * 9)
    q = learn([long, short], 2)["structural"]
    np.testing.assert_allclose(q, [0.5 * (900.5 / 901 + 0.5 / 10), 0.5 * (0.5 / 901 + 9.5 / 10)])
    assert q.sum() == pytest.approx(1.0)


def test_script_writes_what_a_configuration_can_include(run_script, tmp_path):
    run = write_run(tmp_path / "a", [0.1, 0.6])
    done = run_script("learn_reference.py", run, "--output", tmp_path / "q.yaml", "--bins", 4)
    assert done.returncode == 0, done.stderr
    lines = (tmp_path / "q.yaml").read_text().splitlines()
    assert lines[1:3] == ["degeneracy:", "  histogram_bins: 4"]
    assert lines[3] == '  reference_structural: "0.3750 0.1250 0.3750 0.1250"'
    assert [line.split(":")[0].strip() for line in lines[4:]] == ["reference_sparse", "reference_dynamic"]


def test_a_table_without_sub_factors_is_named(run_script, tmp_path):
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "degeneracy.csv").write_text("stamp,fdi\n1,0.5\n")
    done = run_script("learn_reference.py", tmp_path / "a", "--output", tmp_path / "q.yaml")
    assert done.returncode == 2 and "structural" in done.stderr

"""Programs in place of simulate_bag and offline_slam, for the tests of scripts that run them."""

from pathlib import Path

# The truth is a circle of 10 m at 5 m/s. `offset`: the estimate leaves it by so much upwards and downwards in turn, which
# no alignment takes away.
COMMON = '''#!/usr/bin/python3
import math, pathlib, sys
arguments = dict(zip(sys.argv[1::2], sys.argv[2::2]))
settings = [sys.argv[k + 1] for k in range(len(sys.argv)) if sys.argv[k] == "--set"]

def write_poses(path, begin, end, offset):
    with open(path, "w", encoding="utf-8") as out:
        for i in range(int(10 * begin), int(10 * end)):
            a = 0.05 * i
            row = (100 + 0.1 * i, 10 * math.cos(a), 10 * math.sin(a), offset * (-1) ** i, 0, 0, math.sin(a / 2),
                   math.cos(a / 2))
            out.write(" ".join(repr(float(number)) for number in row) + "\\n")
'''
SIMULATE = COMMON + '''
stem = arguments["--output"][:-len(".bag")]
write_poses(stem + ".tum", 0.0, float(arguments["--duration"]), 0.0)
for ending in (".bag", ".labels", ".config.yaml"):
    pathlib.Path(stem + ending).write_text("\\n".join(settings))
'''


def install(folder: Path, slam: str) -> Path:
    """Writes simulate_bag and an offline_slam of the given text into a new folder, which is returned."""
    folder.mkdir()
    for name, text in (("simulate_bag", SIMULATE), ("offline_slam", slam)):
        (folder / name).write_text(text)
        (folder / name).chmod(0o755)
    return folder

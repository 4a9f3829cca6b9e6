"""What a benchmark consists of: scenarios, seeds, configurations, and the stored result of each cell."""

import hashlib
import json
import os
import re
import shlex
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Dict, List, Optional, Sequence, Tuple

from .errors import UserError

LAST_TUNING_SEED = 10  # seeds up to here may be looked at while tuning; those above are for reporting
LARGEST_SEED = 2147483647  # what simulate_bag takes
NEEDS_A_RECORDING = "kitti"  # follows a pose file that is not part of the package
NAME_PATTERN = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]*")

Record = Dict[str, Any]  # the JSON of one cell


@dataclass(frozen=True)
class Configuration:
    """A name and the parameters that differ from the recording's own configuration."""

    name: str
    overrides: Tuple[str, ...] = ()


@dataclass(frozen=True)
class Place:
    """One recording: a scenario, drawn from a seed. `duration_s` None is the scenario's own duration."""

    scenario: str
    seed: int
    duration_s: Optional[float] = None

    @property
    def stem(self) -> str:
        """Name of its files."""
        return f"{self.scenario}_{self.seed}" + (f"_{self.duration_s:g}s" if self.duration_s else "")


def known_scenarios(folder: Path) -> List[str]:
    """The scenarios that need nothing but a seed, the hard variants after the normal ones."""
    names = [file.stem for file in folder.glob("*.yaml") if file.stem != NEEDS_A_RECORDING]
    return sorted(names, key=lambda name: (name.endswith("_hard"), name))


def chosen_scenarios(names: Optional[Sequence[str]], folder: Path) -> List[str]:
    """`names` without repetitions, or all scenarios."""
    known = known_scenarios(folder)
    if not known:
        raise UserError(
            f"{folder}: holds no scenarios (NAME.yaml): give another --scenario-folder, or run the script from a "
            "whole checkout of the package"
        )
    if not names:
        return known
    if NEEDS_A_RECORDING in names:
        raise UserError(f"scenario '{NEEDS_A_RECORDING}' needs a pose file, so it is not part of the benchmark")
    unknown = [name for name in names if name not in known]
    if unknown:
        listed = ", ".join(f"'{name}'" for name in unknown)
        raise UserError(f"unknown scenario {listed}: those in {folder} are {' '.join(known)}")
    return list(dict.fromkeys(names))


def parse_seeds(text: str) -> List[int]:
    """`11-13`, `11,14`, `11-13,20`: whole numbers and ranges, each seed once."""
    seeds: List[int] = []
    for part in text.split(","):
        match = re.fullmatch(r"\s*(\d+)(?:-(\d+))?\s*", part)
        if not match:
            raise UserError(f"--seeds '{text}': '{part}' is no seed or range: write 11-13 or 11,12,20")
        first, last = int(match[1]), int(match[2] or match[1])
        if last < first:
            raise UserError(f"--seeds '{text}': the range {part.strip()} runs backwards: write {last}-{first}")
        if last > LARGEST_SEED or last - first >= 1000:
            raise UserError(f"--seeds '{text}': at most 1000 seeds, none above {LARGEST_SEED}")
        seeds += range(first, last + 1)
    return list(dict.fromkeys(seeds))


def named_value(option: str, text: str) -> Tuple[str, str]:
    """NAME=VALUE with a name that can be part of a file name."""
    name, equals, value = text.partition("=")
    if not equals or not NAME_PATTERN.fullmatch(name):
        raise UserError(f"{option} '{text}': write NAME=..., with letters, digits, _ - and . in NAME")
    return name, value


def parse_configurations(texts: Sequence[str]) -> List[Configuration]:
    """`full` without overrides, then those of the command line; `full=...` redefines the first."""
    found: Dict[str, Configuration] = {"full": Configuration("full")}
    for index, text in enumerate(texts):
        name, value = named_value("--config", text)
        try:
            overrides = tuple(shlex.split(value))
        except ValueError as error:
            raise UserError(f"--config '{text}': {error}") from None
        bad = [override for override in overrides if not re.match(r"[^=]+=", override)]
        if bad:
            raise UserError(f"--config '{text}': '{bad[0]}' is no key=value")
        if any(other.split("=", 1)[0] == name for other in texts[:index]):
            raise UserError(f"--config: two configurations are called '{name}'")
        found[name] = Configuration(name, overrides)
    return list(found.values())


def parse_comparisons(
    texts: Sequence[str], configurations: Sequence[Configuration], places: Sequence[Place]
) -> Dict[str, Path]:
    """NAME=DIR of other programs; each folder must hold at least one trajectory that can be compared."""
    found: Dict[str, Path] = {}
    for text in texts:
        name, value = named_value("--compare", text)
        if name in found or name in [configuration.name for configuration in configurations]:
            raise UserError(f"--compare: the name '{name}' is taken by another column")
        folder = Path(value)
        if not folder.is_dir():
            raise UserError(f"--compare {text}: {folder} is no folder")
        if not any(compared_file(folder, place).is_file() for place in places):
            raise UserError(
                f"--compare {text}: {folder} holds no matching trajectory: they are called SCENARIO_SEED.tum, "
                f"such as {compared_file(folder, places[0]).name}"
            )
        found[name] = folder
    return found


def compared_file(folder: Path, place: Place) -> Path:
    """Where the trajectory of another program is expected."""
    return folder / f"{place.scenario}_{place.seed}.tum"


def digest(files: Sequence[Path]) -> str:
    """A short hash of what the files hold."""
    total = hashlib.sha256()
    for file in files:
        total.update(hashlib.sha256(file.read_bytes()).digest())
    return total.hexdigest()[:12]


def scenario_files(folder: Path, name: str) -> List[Path]:
    """The file of a scenario and those that it builds on."""
    files: List[Path] = []
    file: Optional[Path] = folder / f"{name}.yaml"
    while file is not None and file.is_file() and file not in files:
        files.append(file)
        base = re.search(r"^base:\s*(\S+)", file.read_text(encoding="utf-8"), re.MULTILINE)
        file = file.parent / base[1] if base else None
    return files


def cell_file(output: Path, place: Place, configuration: str) -> Path:
    """Where the result of a cell is stored."""
    return output / "cells" / f"{place.stem}_{configuration}.json"


def read_json(file: Path) -> Optional[Any]:
    """What the file holds, or None if it is missing or broken (it is then made again)."""
    try:
        return json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None


def write_json(file: Path, content: Any) -> None:
    """Writes the whole file or nothing, so that an interruption leaves no half of it."""
    file.parent.mkdir(parents=True, exist_ok=True)
    part = file.with_name(file.name + ".part")
    part.write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")
    os.replace(part, file)


def finished(output: Path, place: Place, configuration: str, identity: Record) -> Optional[Record]:
    """The stored result of a cell if it was made with the same settings, programs and scenario.

    A cell whose recording could not be made says nothing about the system, so it does not count.
    """
    record = read_json(cell_file(output, place, configuration))
    if not isinstance(record, dict) or record.get("failed_at") == "simulation":
        return None
    return record if all(record.get(key) == value for key, value in identity.items()) else None

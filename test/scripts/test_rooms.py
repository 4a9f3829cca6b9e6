"""The rooms of the library build on each other in one direction, that of docs/conventions.md."""
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
INCLUDE = re.compile(r'#include "fdi_lio/(\w+)/(\w+)\.hpp"')


def documented_rooms() -> list[str]:
    text = (ROOT / "docs" / "conventions.md").read_text()
    table = text.split("## Rooms", 1)[1].split("\n## ", 1)[0]
    return re.findall(r"^\| `(\w+)` \|", table, re.MULTILINE)


def sources(room: str) -> list[Path]:
    folders = [ROOT / "src" / room, ROOT / "include" / "fdi_lio" / room]
    return [path for folder in folders for path in folder.rglob("*.?pp")]


def test_every_room_is_documented():
    found = {path.name for path in (ROOT / "include" / "fdi_lio").iterdir() if path.is_dir()}
    assert sorted(found) == sorted(documented_rooms())


def test_rooms_use_only_those_above_them():
    rooms = documented_rooms()
    wrong = []
    for number, room in enumerate(rooms):
        for path in sources(room):
            for used, header in INCLUDE.findall(path.read_text()):
                is_config_of_room = room == "common" and header.endswith("_config")
                if used not in rooms[: number + 1] and not is_config_of_room:
                    wrong.append(f"{path.relative_to(ROOT)} includes {used}/{header}.hpp")
    assert not wrong, "\n".join(wrong)

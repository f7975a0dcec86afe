"""The rooms of sarcl and their imports, as a drawing and a table: python docs/developers/draw_architecture.py

A room is a folder below sarcl/; the files beside the rooms are the room "sarcl". Every import statement of sarcl/ is
read, those inside functions too, those for type checkers alone not. The order of the layers is that of the
import-linter contract in pyproject.toml. Writes architecture.svg and the table between the markers in architecture.md;
tests/house/test_architecture.py fails while these differ from what this script makes.
"""

from __future__ import annotations

import ast
import re
import sys
import tomllib
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

PACKAGE = "sarcl"
PAGE, DRAWING = "docs/developers/architecture.md", "docs/developers/architecture.svg"
COMMAND = "python docs/developers/draw_architecture.py"
MARKERS = f"<!-- rooms: written by {COMMAND} -->", "<!-- end of rooms -->"
SLACK = 0.1  # relative change of a room's lines up to which the number on the page stays as it is


@dataclass(frozen=True)
class House:
    """The rooms by layer, top first, and what is in them.

    files, lines  number of Python files and of their lines, by room
    imports       (importing room, imported room) -> number of pairs of files, the rooms' own left out
    """

    layers: list[list[str]]
    files: dict[str, int]
    lines: dict[str, int]
    imports: dict[tuple[str, str], int]

    @property
    def rooms(self) -> list[str]:
        """All rooms in the order of layers."""
        return [room for layer in self.layers for room in layer]

    def layer(self, room: str) -> int:
        """Number of the layer of a room, 0 at the top."""
        return next(i for i, layer in enumerate(self.layers) if room in layer)


def layers(pyproject: Path) -> list[list[str]]:
    """Rooms by layer, top first, from the contract; ValueError where there is none."""
    contracts = tomllib.loads(pyproject.read_text()).get("tool", {}).get("importlinter", {}).get("contracts", [])
    for contract in contracts:
        if contract.get("type") == "layers" and contract.get("containers") == [PACKAGE]:
            return [
                [name.strip(" ()").removeprefix(f"{PACKAGE}.") for name in re.split("[|:]", layer)]
                for layer in contract["layers"]
            ]
    raise ValueError(
        f'{pyproject} has no [[tool.importlinter.contracts]] with type = "layers" and containers = ["{PACKAGE}"]; '
        "the order of the rooms is read from it: add it"
    )


def read(root: Path, shown: dict[str, int] | None = None) -> House:
    """The house as its files are now; `shown`: lines of the rooms as the page has them, kept where nearly right.

    ValueError names a folder that no layer holds.
    """
    order = layers(root / "pyproject.toml")
    modules = {}
    for path in sorted((root / PACKAGE).rglob("*.py")):
        parts = path.relative_to(root).with_suffix("").parts
        modules[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    room_of = {
        name: name.split(".")[1] if len(path.relative_to(root).parts) > 2 else PACKAGE for name, path in modules.items()
    }
    found = set(room_of.values())
    unknown = sorted(found - {PACKAGE, *(room for layer in order for room in layer)})
    if unknown:
        raise ValueError(f"{PACKAGE}/{unknown[0]}/ is in no layer of pyproject.toml's import-linter contract; add it")
    pairs = [(name, other) for name, path in modules.items() for other in sorted(imported(name, path, modules))]
    between = Counter((room_of[a], room_of[b]) for a, b in pairs if room_of[a] != room_of[b])
    lines: Counter[str] = Counter()
    for name, path in modules.items():
        lines[room_of[name]] += len(path.read_text().splitlines())
    rounded = {room: _lines(count, (shown or {}).get(room, 0)) for room, count in lines.items()}
    rooms = [[room for room in layer if room in found] for layer in [[PACKAGE], *order]]
    return House([layer for layer in rooms if layer], dict(Counter(room_of.values())), rounded, dict(between))


def imported(name: str, path: Path, modules: Iterable[str]) -> set[str]:
    """Modules of the package that the module `name` imports, itself left out."""
    package = name if path.name == "__init__.py" else name.rpartition(".")[0]
    found = set()
    for node in _statements(ast.parse(path.read_text()).body):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        else:
            parents = package.split(".")[: len(package.split(".")) - node.level + 1] if node.level else []
            base = ".".join([*parents, *([node.module] if node.module else [])])
            names = [f"{base}.{alias.name}" for alias in node.names]
        for full in names:
            while full and full not in modules:  # a name within a module
                full = full.rpartition(".")[0]
            found |= {full} - {"", name}
    return found


def _statements(nodes: Iterable[ast.AST]) -> Iterator[ast.Import | ast.ImportFrom]:
    """Import statements, but for those below `if TYPE_CHECKING:`."""
    for node in nodes:
        if isinstance(node, (ast.Import, ast.ImportFrom)):
            yield node
        elif isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
            yield from _statements(node.orelse)
        else:
            yield from _statements(ast.iter_child_nodes(node))


def _lines(count: int, shown: int) -> int:
    """A number of lines in two digits; the one shown so far where it is near enough."""
    if abs(shown - count) <= SLACK * count:
        return shown
    unit = 10 ** max(len(str(count)) - 2, 0)
    return round(count / unit) * unit


def table(house: House) -> str:
    """The rooms in the order of layers, with what each imports, nearest layer first."""
    text = "| room | files | lines | imports (pairs of files) |\n|---|---|---|---|\n"
    for i, layer in enumerate(house.layers):
        for room in layer:
            needs = [f"{other} {house.imports[room, other]}" for other in house.rooms if (room, other) in house.imports]
            up = [other for other in house.rooms if (room, other) in house.imports and house.layer(other) <= i]
            wrong = f"; **not downwards: {', '.join(up)}**" if up else ""
            text += f"| {room} | {house.files[room]} | {house.lines[room]} | {', '.join(needs) or 'none'}{wrong} |\n"
    return text


def shown_lines(page: str) -> dict[str, int]:
    """Numbers of lines in the table on the page."""
    return {room: int(lines) for room, lines in re.findall(r"^\| (\w+) \| \d+ \| (\d+) \|", page, flags=re.M)}


CELL, LABEL, TOP, RIGHT = 34, 330, 16, 150
INK, FAINT, BAND, BOX, RED = "#1f2430", "#4a5263", "#f3f5f8", "#dfe7f3", "#c62828"


def drawing(house: House) -> str:
    """SVG: a staircase of rooms; the column below a room holds what it imports, with numbers of pairs of files."""
    rooms = house.rooms
    width, height = LABEL + CELL * len(rooms) + RIGHT, 2 * TOP + CELL * len(rooms)
    most = max(house.imports.values(), default=1)
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" height="{height}" '
        f'font-family="DejaVu Sans, Helvetica, Arial, sans-serif" font-size="15" fill="{INK}">',
        f'<rect width="{width}" height="{height}" fill="#ffffff"/>',
    ]
    for i, layer in enumerate(house.layers):  # bands of the layers
        if i % 2:
            y = TOP + CELL * rooms.index(layer[0])
            parts.append(f'<rect y="{y}" width="{width}" height="{CELL * len(layer)}" fill="{BAND}"/>')
    for i, room in enumerate(rooms):
        x, y = LABEL + CELL * i, TOP + CELL * i
        parts += [
            f'<rect x="8" y="{y + 3}" width="{LABEL - 24}" height="{CELL - 6}" rx="5" fill="{BOX}"/>',
            _text(20, y, room, "start", 'font-weight="bold"'),
            _text(
                LABEL - 26,
                y,
                f"{_count(house.files[room], 'file')}, {_count(house.lines[room], 'line')}",
                "end",
                'font-size="13"',
            ),
            f'<path d="M{LABEL} {y + CELL / 2}H{x}M{x + CELL / 2} {y + CELL}V{height - TOP}" stroke="#d5dae2"/>',
        ]
    for (room, other), count in house.imports.items():
        x, y = LABEL + CELL * rooms.index(room), TOP + CELL * rooms.index(other)
        wrong = house.layer(other) <= house.layer(room)
        fill = f'fill="{RED}"' if wrong else f'fill="#2f6fb7" fill-opacity="{0.12 + 0.5 * (count / most) ** 0.5:.2f}"'
        parts += [
            f'<rect x="{x + 2}" y="{y + 2}" width="{CELL - 4}" height="{CELL - 4}" rx="4" fill="#ffffff"/>',
            f'<rect x="{x + 2}" y="{y + 2}" width="{CELL - 4}" height="{CELL - 4}" rx="4" {fill}/>',
            _text(x + CELL / 2, y, str(count), "middle", 'font-size="13"' + (' fill="#ffffff"' if wrong else "")),
        ]
    for i, room in enumerate(rooms):
        x, y = LABEL + CELL * i, TOP + CELL * i
        parts += [
            f'<rect x="{x + 2}" y="{y + 2}" width="{CELL - 4}" height="{CELL - 4}" rx="4" fill="{INK}"/>',
            _text(x + CELL + 6, y, room, "start", 'font-weight="bold"'),
        ]
    notes = (
        "Down the column below a room: the rooms that it imports.",
        "Along the row of a room: the rooms that import it.",
        "Number: pairs of importing and imported file.",
        "One band: one layer; its rooms do not import one another.",
        "Red: an import that does not point down.",
    )
    for i, note in enumerate(notes):
        parts.append(_text(width - 20, TOP + 24 * i, note, "end", f'font-size="14" fill="{FAINT}"'))
    return "\n".join(parts) + "\n</svg>\n"


def _text(x: float, y: float, words: str, anchor: str, style: str) -> str:
    """Text in the middle of a row that begins at y."""
    return f'<text x="{x}" y="{y + CELL / 2 + 5}" text-anchor="{anchor}" {style}>{words}</text>'


def _count(n: int, noun: str) -> str:
    return f"{n} {noun}" + "s" * (n != 1)


def made(root: Path) -> dict[Path, str]:
    """The page and the drawing as they should be now: path -> text. ValueError where the page lacks its markers."""
    page = (root / PAGE).read_text()
    before, found, rest = page.partition(MARKERS[0])
    _, ended, after = rest.partition(MARKERS[1])
    if not (found and ended):
        raise ValueError(f"{PAGE} lacks the markers of the table: {MARKERS[0]} and, below it, {MARKERS[1]}")
    house = read(root, shown_lines(page))
    text = f"{before}{MARKERS[0]}\n{table(house)}{MARKERS[1]}{after}"
    return {root / PAGE: text, root / DRAWING: drawing(house)}


def main(root: Path) -> int:
    """Write what has changed and name it."""
    for path, text in made(root).items():
        if not path.exists() or path.read_text() != text:
            path.write_text(text)
            print(path.relative_to(root))
    return 0


if __name__ == "__main__":
    sys.exit(main(Path(__file__).parents[2]))

"""Loops and instructions of a kernel in NVIDIA's machine code (SASS), from nvdisasm's listing.

Counting rules: docs/developers/gpu_static.md, "How instructions are counted".
"""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import dataclass, field

# Kinds of instructions; the first pattern that fits an opcode's beginning names its kind.
KINDS = {
    "fp64": r"D(ADD|MUL|FMA|SETP|MNMX)",
    "fp64 conversion": r"(F2F|F2I|I2F|FRND)\.(\w+\.)*F64|(F2F|F2I|I2F|FRND)\.(\w+\.)*\w*64",
    "special function": r"MUFU",
    "load global": r"LDG|LD\.E",
    "store global": r"STG|ST\.E|RED|ATOM",
    "load local memory": r"LDS|LDSM",
    "store local memory": r"STS",
    "load stack": r"LDL",
    "store stack": r"STL",
    "constant": r"LDC|ULDC",
    "fp32": r"F(ADD|MUL|FMA|MNMX|SEL|SETP|SET|CHK)|FFMA|HFMA2",
    "barrier": r"BAR",
    "branch": r"BRA|BRX|BSSY|BSYNC|EXIT|CALL|RET|WARPSYNC|BREAK|YIELD|JMP",
    "integer": r"\w",  # integer arithmetic, moves, conversions of 32 bit, predicates
}

LINE = re.compile(r"\s*/\*([0-9a-f]+)\*/\s+(@!?U?P\w+\s+)?([A-Z0-9_.]+)\s*(.*?);")
LABEL = re.compile(r"(\.L_x_\d+):")
TARGET = re.compile(r"`\((\.L_x_\d+)\)")


@dataclass
class Loop:
    """Instructions `first` to `last` of a kernel; `last` branches back to `first`."""

    first: int
    last: int
    inside: list[Loop] = field(default_factory=list)

    def holds(self, other: Loop) -> bool:
        """Whether another loop lies within this one."""
        return self.first <= other.first and other.last <= self.last and self is not other


@dataclass
class Code:
    """A kernel's instructions in the order of their addresses, opcodes with modifiers, its outermost loops, and its
    branches: instructions that branch, and those they branch to."""

    opcodes: list[str]
    loops: list[Loop]
    branches: list[tuple[int, int]] = field(default_factory=list)

    def own(self, loop: Loop) -> list[str]:
        """Opcodes of a loop, those of loops inside it left out."""
        inner = [range(i.first, i.last + 1) for i in loop.inside]
        return [self.opcodes[n] for n in range(loop.first, loop.last + 1) if not any(n in r for r in inner)]

    def sides(self, loop: Loop, least: int) -> list[Loop]:
        """Instructions of a loop, `least` at least, that a branch within it passes over, the shortest first.

        Of sides within sides the innermost are taken. Loops inside the loop are left whole: a side that holds one, or
        lies within one, is not among these. A side into whose midst a branch leads from elsewhere is not either.
        """
        found = []
        for at, target in self.branches:
            side = Loop(at + 1, target - 1)
            if not (loop.first <= at and target <= loop.last and side.last - side.first + 1 >= least):
                continue
            if any(side.first <= inner.last and inner.first <= side.last for inner in loop.inside):
                continue
            entries = [t for a, t in self.branches if side.first < t <= side.last and not side.first <= a <= side.last]
            if not entries:
                found.append(side)
        innermost = {(s.first, s.last): s for s in found if not any(s.holds(other) for other in found)}
        return sorted(innermost.values(), key=lambda s: (s.last - s.first, s.first))

    def every_loop(self) -> list[Loop]:
        """All loops, outer ones before those inside them."""
        found, todo = [], list(self.loops)
        while todo:
            loop = todo.pop(0)
            found.append(loop)
            todo = loop.inside + todo
        return found


def kind(opcode: str) -> str:
    """The kind of an opcode, one of KINDS."""
    return next((name for name, pattern in KINDS.items() if re.match(pattern, opcode)), "integer")


def kinds(opcodes: list[str]) -> dict[str, int]:
    """Number of instructions of each kind."""
    return dict(Counter(kind(opcode) for opcode in opcodes).most_common())


def code_of(listing: str, kernel: str) -> Code:
    """Instructions and loops of one kernel in nvdisasm's listing."""
    body = re.search(rf"^\.text\.{kernel}:\n(.*?)(?=^\s*\.section|\Z)", listing, re.S | re.M)
    if body is None:
        raise ValueError(f"kernel {kernel} is not in the listing, which begins {listing[:80]!r}")
    opcodes: list[str] = []
    labels: dict[str, int] = {}
    targets: list[tuple[int, str]] = []
    backward: dict[int, int] = {}  # first instruction of a loop: the last that branches back to it
    for line in body[1].splitlines():
        if label := LABEL.match(line.strip()):
            labels[label[1]] = len(opcodes)
        elif found := LINE.match(line):
            at = len(opcodes)
            opcodes.append(found[3])
            target = TARGET.search(found[4])
            if target and found[3].startswith(("BRA", "JMP", "CALL")):
                targets.append((at, target[1]))
            # a branch to itself is no loop: it follows the kernel's end, so that nothing behind it is ever run
            if found[3].startswith("BRA") and target and labels.get(target[1], at) < at:
                first = labels[target[1]]
                backward[first] = max(backward.get(first, 0), at)
    loops = [Loop(first, last) for first, last in backward.items()]
    for loop in loops:
        inside = [o for o in loops if loop.holds(o)]
        loop.inside = sorted((o for o in inside if not any(p.holds(o) for p in inside)), key=lambda o: o.first)
    outermost = sorted((o for o in loops if not any(p.holds(o) for p in loops)), key=lambda o: o.first)
    return Code(opcodes, outermost, [(at, labels[name]) for at, name in targets if name in labels])

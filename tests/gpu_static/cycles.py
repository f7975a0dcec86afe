"""A model of the cycles of a loop through which the warps of work-groups go together on a multiprocessor of NVIDIA.

Warps issue what the compiler ordered, no earlier than its stall counts and barriers allow; loads and stores go through
one pipe of the multiprocessor. What NVIDIA does not publish is an unknown of the Machine, fitted to measured rates.
How well: docs/developers/gpu_static.md, "The model of cycles".
"""

from __future__ import annotations

import heapq
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from gpu_static import compilers, hot_loops, occupancy
from gpu_static.collect import Variant
from gpu_static.sass import Code, Loop, code_of

CLOCK, UNITS = 1.75e9, 132  # Hz, multiprocessors of an H100 or H200
TARGET = "sm_90"
SCHEDULERS = 4  # of a multiprocessor; each issues an instruction a cycle
QUEUE = 24  # loads and stores that wait for the pipe at most
FIXED = 20  # cycles until others see what an instruction with a barrier but without memory made
INTEGER = r"(IADD3|LOP3|ISETP|SHF|LEA|PRMT|SEL|IMNMX|MOV|VIADD|I2FP|VIMNMX)\b"
# Cycles for which an instruction keeps a unit of its scheduler; others are issued one a cycle.
UNIT = {"MUFU": ("special", 8), "F2I": ("conversion", 4), "I2F": ("conversion", 4), "FRND": ("conversion", 4)}
# The upper half of an instruction's machine word, on a line of its own in the listing
WORD = re.compile(r"^\s*/\* 0x([0-9a-f]{16}) \*/", re.M)
MEMORY = ("LDS", "STS", "LDG")
LAST = "min(SIDE / ITEMS, 1)"  # share of the warps that are the last of a group, not the first


@dataclass(frozen=True)
class Machine:
    """What is not published of a multiprocessor.

    wide      cycles of the pipe for a load of 128 bits from local memory that all lanes take from one place
    first     cycles until the samples of a profile come, for the first warp of a group that asks; hit: for the next
    around    cycles until other data of global memory come, for the first warp
    """

    wide: int = 2
    first: int = 600
    hit: int = 38
    around: int = 260


@dataclass(frozen=True)
class Instruction:
    """An instruction and its controls: cycles until the next, barriers that it sets when it has read or written, and
    those that it waits for, as bits."""

    opcode: str
    stall: int = 1
    read: int = 7
    write: int = 7
    wait: int = 0

    @classmethod
    def of(cls, opcode: str, word: int) -> Instruction:
        """From the upper half of its machine word, of compute capability 7.0 and later."""
        return cls(opcode, word >> 41 & 15, word >> 49 & 7, word >> 46 & 7, word >> 52 & 63)


@dataclass(frozen=True)
class Program:
    """A kernel's machine code: instructions, loops and branches, and each instruction with its controls."""

    code: Code
    instructions: list[Instruction]

    @classmethod
    def of(cls, listing: str, kernel: str) -> Program:
        """From nvdisasm's listing with machine words."""
        code = code_of(listing, kernel)
        body = re.split(r"^\s*\.section", listing.split(f"\n.text.{kernel}:\n")[1], maxsplit=1, flags=re.M)[0]
        words = [int(word, 16) for word in WORD.findall(body)]
        return cls(code, [Instruction.of(*each) for each in zip(code.opcodes, words, strict=True)])


def path(program: Program, loop: Loop, trips: int, sides: Mapping[tuple[int, int], bool]) -> list[Instruction]:
    """Instructions of one trip of a loop by a warp.

    trips  of the loops inside it
    sides  {(first, last) of the instructions behind a branch: whether the warp takes them}; it takes those that are
           not named
    """
    targets = dict(program.code.branches)
    out: list[Instruction] = []
    n, rest = loop.first, trips
    while n <= loop.last:
        out.append(program.instructions[n])
        target = targets.get(n)
        if target is None or n == loop.last or not out[-1].opcode.startswith("BRA"):
            n += 1
        elif target <= n:  # of a loop inside
            rest -= 1
            n = target if rest > 0 else n + 1
        else:
            empty = not trips and any(n < inner.first and inner.last < target for inner in loop.inside)
            n = target if empty or not sides.get((n + 1, target - 1), True) else n + 1
    return out


def warps(program: Program, loop: Loop, hot: hot_loops.Hot, macros: dict[str, int]) -> list[list[Instruction]]:
    """Paths of a group's warps through the hot loop: the first take what makes samples, the last what makes weights."""
    n = occupancy.warps_of(macros["ITEMS"])
    samples = macros["FINE"] * macros["SIDE"] + macros["LINE_TAPS"] + 10
    found = [s for here in (loop, *hot_loops.inside(loop)) for s in program.code.sides(here, hot.shortest)]
    expected = hot.sides[-len(found) :]  # reading and writing samples is one side where nothing is read ahead
    if not len(hot.sides) - 1 <= len(found) <= len(hot.sides):
        raise hot_loops.NotCounted(f"{len(found)} sides of branches are there, {len(hot.sides)} are known")
    out = []
    for warp in range(n):
        takes = {}
        for side, share in zip(found, expected, strict=True):
            part = hot_loops.evaluated(share, macros) * n
            takes[side.first, side.last] = warp >= n - part if share == LAST else warp < part
        out.append(path(program, loop, len(range(macros["ITEMS"] + 32 * warp, samples, macros["ITEMS"])), takes))
    return out


class _Multiprocessor:
    """Warps on their way; time t in cycles."""

    def __init__(self, paths: Sequence[Sequence[Instruction]], groups: int, machine: Machine, trips: int) -> None:
        self.paths, self.machine, self.trips = paths, machine, trips
        n = groups * len(paths)
        self.at, self.trip, self.ready, self.waits = [0] * n, [0] * n, [0] * n, [False] * n
        self.pending = [[0] * 8 for _ in range(n)]  # barriers of each warp: operations that have not ended
        self.arrived = [0] * groups
        self.done = 0.0  # trips of all warps together, parts of them too
        self.events: list[tuple[int, int, int]] = []  # (t, warp, barrier)
        self.queue: list[int] = []  # t at which operations of memory enter the pipe
        self.pipe = 0
        self.units = [dict.fromkeys(("special", "conversion", "integer"), 0) for _ in range(SCHEDULERS)]
        self.last = [-1] * SCHEDULERS
        self.touched: dict[tuple[int, int, bool], int] = {}
        self.decoded = {id(i): _decoded(i) for path in paths for i in path}

    def can(self, warp: int, scheduler: int, t: int) -> bool:
        """Whether a warp can issue its next instruction."""
        if self.waits[warp] or self.ready[warp] > t:
            return False
        instruction = self.paths[warp % len(self.paths)][self.at[warp]]
        pending = self.pending[warp]
        if instruction.wait and any(instruction.wait >> b & 1 and pending[b] for b in range(6)):
            return False
        name, unit, _, _ = self.decoded[id(instruction)]
        if name in MEMORY and len(self.queue) >= QUEUE:
            return False
        return not unit or self.units[scheduler][unit] <= t

    def issue(self, warp: int, scheduler: int, t: int) -> None:
        """Issue the next instruction of a warp."""
        n = len(self.paths)
        instruction = self.paths[warp % n][self.at[warp]]
        name, unit, cycles, width = self.decoded[id(instruction)]
        if unit:
            self.units[scheduler][unit] = t + cycles
        read, done = t + 10, t + FIXED
        if name in MEMORY:
            begin = max(self.pipe, t + 4)
            taken, latency = self.memory(name, width, warp, t)
            self.pipe = begin + taken
            heapq.heappush(self.queue, begin)
            read, done = begin + taken, begin + latency
        for barrier, when in ((instruction.read, read), (instruction.write, done)):
            if barrier != 7:
                self.pending[warp][barrier] += 1
                heapq.heappush(self.events, (when, warp, barrier))
        self.ready[warp] = t + max(1, instruction.stall)
        if name == "BAR":
            group = warp // n
            self.arrived[group] += 1
            self.waits[warp] = True
            if self.arrived[group] == n:
                self.arrived[group] = 0
                for other in range(group * n, group * n + n):
                    self.waits[other], self.ready[other] = False, max(self.ready[other], t + 20)
        self.at[warp] += 1
        self.done += 1 / len(self.paths[warp % n])
        if self.at[warp] == len(self.paths[warp % n]):
            self.at[warp] = 0
            self.trip[warp] += 1

    def memory(self, name: str, width: int, warp: int, t: int) -> tuple[int, int]:
        """Cycles that an operation keeps the pipe, and until its result is there."""
        machine = self.machine
        if name == "LDS":
            taken = {32: 1, 64: 2, 128: machine.wide}[width]
            return taken, 23 + taken
        if name == "STS":
            return {32: 1, 64: 3, 128: 8}[width], 20
        long = machine.first if width == 64 else machine.around
        since = self.touched.setdefault((warp // len(self.paths), self.trip[warp], width == 64), t)
        return 2 if width == 64 else 1, long if since + long > t else machine.hit

    def run(self, warm: int) -> float:
        """Cycles per trip of a group, from trip `warm` of the first warp to its last, while all run."""
        t, start, n = 0, None, len(self.at)
        mine = [list(range(s, n, SCHEDULERS)) for s in range(SCHEDULERS)]
        while self.trip[0] < self.trips:
            while self.events and self.events[0][0] <= t:
                _, warp, barrier = heapq.heappop(self.events)
                self.pending[warp][barrier] -= 1
            while self.queue and self.queue[0] <= t:
                heapq.heappop(self.queue)
            issued = False
            for s in range(SCHEDULERS):
                first = [self.last[s]] if self.last[s] >= 0 else []
                for warp in (*first, *mine[s]):  # the last one again, else the first that can
                    if self.can(warp, s, t):
                        self.issue(warp, s, t)
                        self.last[s], issued = warp, True
                        break
            if start is None and self.trip[0] == warm:
                start = t, self.done
            end = t, self.done
            t = t + 1 if issued else self.next(t)
        assert start is not None
        return (end[0] - start[0]) / (end[1] - start[1]) * len(self.paths)

    def next(self, t: int) -> int:
        """The next time at which anything changes."""
        times = [time for time in (*self.ready, *(v for unit in self.units for v in unit.values())) if time > t]
        times += [self.events[0][0]] if self.events else []
        times += self.queue[:1]
        return max(t + 1, min(times, default=t + 1))


def _decoded(instruction: Instruction) -> tuple[str, str, int, int]:
    """Name of an instruction, its unit ("" where it keeps none), cycles that it keeps it, and bits that it moves."""
    name, *modifiers = instruction.opcode.split(".")
    unit, cycles = UNIT.get(name, ("integer", 2) if re.match(INTEGER, name) else ("", 1))
    return name, unit, cycles, next((width for width in (128, 64) if str(width) in modifiers), 32)


def cycles(
    paths: Sequence[Sequence[Instruction]], groups: int, machine: Machine, trips: int = 24, warm: int = 4
) -> float:
    """Cycles of a multiprocessor per trip of one group, of `groups` that it holds; paths: of a group's warps."""
    return _Multiprocessor(paths, groups, machine, trips).run(warm)


def compiled(variant: Variant, kernel: str, text: str, folder: Path) -> tuple[Program, int]:
    """A kernel compiled for sm_90, and the groups of it that a multiprocessor holds. DoesNotCompile: it is refused."""
    found = compilers.compiled(variant, folder, text)[TARGET]
    if "error" in found:
        raise compilers.DoesNotCompile(found["error"])
    figures, items = dict(found[kernel]), dict(variant.macros)["ITEMS"]
    groups = occupancy.groups(TARGET, figures["registers"], figures["local memory"], items)
    return Program.of(compilers.listing(TARGET, folder), kernel), groups


# Nearest of three to 51 variants of lines that work-groups share, measured on an H100 (bench/results/gpu/h100.json):
# calibration.py. Wide loads of 2 cycles, or samples after 600 cycles, are about as near.
H100 = Machine(wide=1, first=300)


def rate(program: Program, hot: hot_loops.Hot, macros: dict[str, int], groups: int, machine: Machine = H100) -> float:
    """Contributions per second of an H100 or H200 at CLOCK: a model.

    The loop around the hot one adds its instructions' share.
    """
    loop = hot_loops.hot_loop(program.code, hot.loop)
    if loop is None:
        raise hot_loops.NotCounted(f"no loop of the kind {hot.loop!r} is there")
    paths = warps(program, loop, hot, macros)
    total = hot_loops.cost(program.code, hot, macros).trip * len(paths) / sum(map(len, paths))
    pairs = hot_loops.evaluated(hot.contributions, macros) * macros["ITEMS"]
    return CLOCK * UNITS * pairs / (cycles(paths, groups, machine) * max(total, 1.0))

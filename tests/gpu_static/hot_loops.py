"""Instructions per contribution of a kernel's hot loop.

Counting rules: docs/developers/gpu_static.md, "How instructions are counted".
"""

from __future__ import annotations

from dataclasses import dataclass

from gpu_static.sass import Code, Loop, kind, kinds


@dataclass(frozen=True)
class Hot:
    """Which loop of a kernel is hot, and what one trip of it computes. Expressions are of the macros.

    contributions  of one trip of the loop, by one work-item: an expression
    unit           what a contribution is
    loop           "innermost": the innermost loop with most instructions;  "loads": that with most loads from global
                   memory, where the compiler unrolls another one further;  "barrier": the smallest loop with a barrier,
                   through which the items of a work-group go together;  "around": the smallest loop around such a loop;
                   "kernel": all of it, each instruction once
    trips          trips of each loop inside the hot one, in order of addresses, loops inside these right after each:
                   expressions
    sides          shares of the trips in which a work-item's warp takes each side of a branch that has `shortest`
                   instructions or more, the shortest first, inner loops' after those of the loops around them:
                   expressions. For branches that whole warps take alike; where lanes of a warp may differ there is no
                   entry, and both sides count, as they do where the machine code has other branches than these
    around         trips of the hot loop per trip of the loop around it, whose share is then counted too: an expression
    trips_around   as `trips`, of the loops inside that loop, but for the hot one
    unrolled       contributions of a work-item where the compiler unrolls the hot loop and no other is left
    shortest       instructions of the shortest side of a branch that may count for a share
    merged         how many of the first `sides` the machine code does not have: an expression
    """

    contributions: str
    unit: str
    loop: str = "innermost"
    trips: tuple[str, ...] = ()
    sides: tuple[str, ...] = ()
    around: str = ""
    trips_around: tuple[str, ...] = ()
    unrolled: str = ""
    shortest: int = 64
    merged: str = "0"


# share of the items of a group that make samples of T
T_ITEMS = "min(-(-(FINE * SIDE + LINE_TAPS + 10) // 32) * 32 / ITEMS, 1)"


# By file and kernel. For kernels that are not listed the figure is the instructions of one trip of their largest
# innermost loop, or of the kernel where it has no loop.
HOT = {
    # pairs that lie inside of windows; the longer side looks at each pixel of tiles that cross their edges
    ("backproject.cl", "backproject"): Hot("VECTORS * VW", "pulse and pixel", sides=("1", "0")),
    ("backproject_float64.cl", "backproject"): Hot("VW", "pulse and pixel"),
    ("backproject_lines.cl", "backproject_lines"): Hot("VW", "pulse and pixel"),
    # The first items read and write samples of T: those that all lines read, and up to ten more where lines lie across
    # the range. The loop inside makes those that are more than there are items. The last SIDE items make the weights of
    # a line each. Whole warps do all this; all add to their sums.
    ("backproject_shared_lines.cl", "backproject_shared_lines"): Hot(
        "SIDE * SIDE / ITEMS",
        "pulse and pixel",
        loop="barrier",
        trips=("max(-(-(FINE * SIDE + LINE_TAPS + 10) // 32) * 32 - ITEMS, 0) / ITEMS",),
        sides=(T_ITEMS, T_ITEMS, "min(SIDE / ITEMS, 1)", "1"),
        shortest=32,
        merged="int(SLOPE_TAPS > 0)",  # which are read where they are written
        # Per group of pulses: sums are turned by its curvature, line by line; they join the image where that ends a
        # chunk, else those of the next group. Pulses pixel by pixel (two loops in a third) are none of these pairs.
        around="GROUP",
        trips_around=(
            "SIDE * SIDE / ITEMS / 4 * (GROUP >= CHUNK)",
            "0",
            "0",
            "0",
            "SIDE * SIDE / ITEMS / 4 * (GROUP < CHUNK)",
            "GROUP * 6 / ITEMS",  # what is known of the pulses, 24 numbers each
        ),
    ),
    ("schedule_pulses.cl", "schedule_pulses"): Hot("1", "pulse and tile", loop="kernel", trips=("1", "1", "1")),
    ("tile_constants.cl", "line_constants"): Hot("VW", "pulse and tile", loop="kernel"),
    ("tile_constants.cl", "tile_constants"): Hot("VW", "pulse and tile", loop="kernel"),
    ("beam.cl", "add"): Hot("USED * VW", "element and value of the beam"),
    ("beam.cl", "paths"): Hot("VW", "element and entry"),
    ("beam.cl", "times"): Hot("VW", "element and entry"),
    ("compression_filter.cl", "compress"): Hot("1", "sample of a Doppler bin", loop="kernel"),
    ("current_sums.cl", "current_sums"): Hot("8 * VW", "cell, frequency and pulse"),  # BLOCK in the kernel
    ("merge_subapertures.cl", "merge"): Hot("1", "pulse and sample of a profile", loop="loads"),
    # a trip of a group's 64 items adds up to 64 samples: instructions of all items per sample
    ("nufft2d.cl", "spread"): Hot("1", "sample and tile of the grid", loop="barrier", trips=("64",)),
    ("range_doppler.cl", "straighten_onto"): Hot("1", "sample", loop="kernel"),
    ("ray_casting.cl", "hidden"): Hot("1", "node of the tree and ray"),
    ("rays.cl", "any_hit"): Hot("1", "node of the tree and ray"),
    ("rays.cl", "nearest"): Hot("1", "node of the tree and ray"),
    ("spectral_echo.cl", "spread"): Hot("1", "scatterer and tile of the grid", loop="barrier", trips=("64",)),
    ("facet_amplitudes.cl", "facet_amplitudes"): Hot("VW", "pulse node, facet and frequency", unrolled="VW * NODES"),
    ("spread_facets.cl", "spread_facets"): Hot("VW", "pulse and facet", loop="around", trips=("1",)),
    # each item brings a scatterer; the loop inside adds those of the group up, and runs again where a window moves
    ("spread_leaves.cl", "leaves"): Hot("VW", "kept pulse and point"),
    ("row_gradients_float64.cl", "row_gradients"): Hot("VW", "pulse and point"),
    ("spread_float64.cl", "spread"): Hot("VW", "pulse and point"),
    ("spread_points.cl", "spread"): Hot("VW", "pulse and scatterer", loop="around", trips=("1",)),
}


@dataclass(frozen=True)
class Cost:
    """Instructions of one trip of a hot loop, in all and by kind, and the contributions that a trip makes.

    most  instructions of one trip that took both sides of every branch
    """

    trip: float
    contributions: float
    unit: str
    by_kind: dict[str, float]
    most: float

    @property
    def each(self) -> float:
        """Instructions per contribution."""
        return self.trip / self.contributions

    @property
    def each_at_most(self) -> float:
        """Instructions per contribution, both sides of every branch counted."""
        return self.most / self.contributions


class NotCounted(Exception):
    """The loops in the machine code are not those that HOT describes; the message says which there are."""


def described(code: Code) -> str:
    """The loops of a kernel in words."""
    return ", ".join(
        f"instructions {loop.first} to {loop.last} ({loop.last - loop.first + 1}, "
        f"{len(code.own(loop))} outside of its {len(loop.inside)} inner loops)"
        for loop in code.every_loop()
    )


def hot_loop(code: Code, which: str) -> Loop | None:
    """The hot loop; None where the kernel has no loop."""
    loops = code.every_loop()
    if which == "kernel":
        return Loop(0, len(code.opcodes) - 1, list(code.loops))
    if which in ("innermost", "loads"):
        loops = [loop for loop in loops if not loop.inside]
        if which == "loads":
            return max(loops, key=lambda loop: kinds(code.own(loop)).get("load global", 0), default=None)
    else:
        loops = [loop for loop in loops if any(code.opcodes[n].startswith("BAR") for n in range(loop.first, loop.last))]
        if which == "around":
            loops = [loop for loop in loops if any(inner in loops for inner in loop.inside)]
        return min(loops, key=lambda loop: loop.last - loop.first, default=None)
    return max(loops, key=lambda loop: loop.last - loop.first, default=None)


def cost(code: Code, hot: Hot | None, macros: dict[str, int]) -> Cost:
    """Instructions per contribution of a kernel. NotCounted where its loops are not as `hot` says."""
    loop = hot_loop(code, hot.loop if hot else "innermost")
    if loop is None:
        n = len(code.opcodes)
        if hot and hot.unrolled and not code.loops:
            each = {k: float(v) for k, v in kinds(code.opcodes).items()}
            return Cost(n, evaluated(hot.unrolled, macros), hot.unit, each, n)
        if hot:
            raise NotCounted(f"no loop of the kind {hot.loop!r} is there; found: {described(code) or 'no loop at all'}")
        return Cost(n, 1.0, "work-item", {k: float(v) for k, v in kinds(code.opcodes).items()}, n)
    if hot is None:
        own = code.own(loop)
        return Cost(len(own), 1.0, "trip", {k: float(v) for k, v in kinds(own).items()}, len(own))
    count = Counter()
    sides = [side for here in (loop, *inside(loop)) for side in code.sides(here, hot.shortest)] if hot.sides else []
    shares = {}
    expected = hot.sides[int(evaluated(hot.merged, macros)) :] if hot.sides else ()
    if len(sides) == len(expected):
        shares = {(side.first, side.last): share for side, share in zip(sides, expected, strict=True)}
    count.add(code, loop, 1.0, hot.trips, shares, macros)
    if hot.around:
        outer = min((o for o in code.every_loop() if o.holds(loop)), key=lambda o: o.last - o.first, default=None)
        if outer is None:
            raise NotCounted(f"no loop is around the hot one; found: {described(code)}")
        rest = Loop(outer.first, outer.last, [o for o in outer.inside if o.first != loop.first])
        count.add(code, rest, 1 / evaluated(hot.around, macros), hot.trips_around, {}, macros, but=loop)
    return Cost(
        sum(count.by_kind.values()), evaluated(hot.contributions, macros), hot.unit, dict(count.by_kind), count.most
    )


class Counter:
    """Instructions, each as often as it runs: by kind, and the sum with both sides of every branch."""

    def __init__(self) -> None:
        self.by_kind: dict[str, float] = {}
        self.most = 0.0

    def add(
        self, code: Code, loop: Loop, trips: float, inner_trips: tuple[str, ...], shares: dict[tuple[int, int], str],
        macros: dict[str, int], but: Loop | None = None,
    ) -> None:  # fmt: skip
        """Add a loop that runs `trips` times, and those inside it, without the instructions of the loop `but`."""
        inner = inside(loop)
        if len(inner) != len(inner_trips):
            raise NotCounted(
                f"trips of {len(inner_trips)} loops inside the one counted are known, {len(inner)} are there; "
                f"found: {described(code)}; write their trips in tests/gpu_static/hot_loops.py"
            )
        all_trips = {id(loop): trips}
        given = dict(zip(map(id, inner), inner_trips, strict=True))
        todo = [loop]
        while todo:
            here = todo.pop(0)
            for child in here.inside:
                all_trips[id(child)] = all_trips[id(here)] * evaluated(given[id(child)], macros)
                todo.append(child)
            skipped = [*here.inside, *([but] if but and here is loop else [])]
            sides = [side for side in code.sides(here, 1) if (side.first, side.last) in shares]
            for n in range(here.first, here.last + 1):
                if any(part.first <= n <= part.last for part in skipped):
                    continue
                often, name = all_trips[id(here)], kind(code.opcodes[n])
                self.most += often
                for side in sides:
                    if side.first <= n <= side.last:
                        often *= evaluated(shares[side.first, side.last], macros)
                self.by_kind[name] = self.by_kind.get(name, 0.0) + often


def evaluated(expression: str, macros: dict[str, int]) -> float:
    """Value of an expression of macros."""
    return float(eval(expression, {}, dict(macros)))


def inside(loop: Loop) -> list[Loop]:
    """Every loop inside a loop: by address, those inside them right after each."""
    return [found for child in loop.inside for found in (child, *inside(child))]

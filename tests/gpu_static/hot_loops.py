"""Instructions per contribution of a kernel's hot loop.

Counting rules: docs/developers/gpu_static.md, "How instructions are counted".
"""

from __future__ import annotations

from dataclasses import dataclass

from gpu_static.sass import Code, Loop, kinds


@dataclass(frozen=True)
class Hot:
    """Which loop of a kernel is hot, and what one trip of it computes. Expressions are of the macros.

    contributions  of one trip of the loop, by one work-item: an expression
    unit           what a contribution is
    loop           "innermost": the innermost loop with most instructions;  "barrier": the smallest loop with a barrier,
                   through which the items of a work-group go together;  "around": the smallest loop around such a loop
    trips          trips of each loop inside the hot one, in order of addresses, loops inside these right after each:
                   expressions
    """

    contributions: str
    unit: str
    loop: str = "innermost"
    trips: tuple[str, ...] = ()


# By file and kernel. For kernels that are not listed the figure is the instructions of one trip of their largest
# innermost loop, or of the kernel where it has no loop.
HOT = {
    ("backproject.cl", "backproject"): Hot("VECTORS * VW", "pulse and pixel"),
    ("backproject_float64.cl", "backproject"): Hot("VW", "pulse and pixel"),
    ("backproject_lines.cl", "backproject_lines"): Hot("VW", "pulse and pixel"),
    # the loop inside makes SIDE weights of lines and about FINE SIDE + 16 samples: a trip of a work-item makes one of
    # both, and is counted as if it made both
    ("backproject_shared_lines.cl", "backproject_shared_lines"): Hot(
        "SIDE * SIDE / ITEMS", "pulse and pixel", loop="barrier", trips=("(SIDE + FINE * SIDE + 16) / ITEMS",)
    ),
    ("beam.cl", "add"): Hot("USED * VW", "element and value of the beam"),
    ("beam.cl", "paths"): Hot("VW", "element and entry"),
    ("beam.cl", "times"): Hot("VW", "element and entry"),
    ("current_sums.cl", "current_sums"): Hot("8 * VW", "cell, frequency and pulse"),  # BLOCK in the kernel
    ("merge_subapertures.cl", "merge"): Hot("1", "pulse and sample of a profile"),
    # a trip of a group's 64 items adds up to 64 samples: instructions of all items per sample
    ("nufft2d.cl", "spread"): Hot("1", "sample and tile of the grid", loop="barrier", trips=("64",)),
    ("range_doppler.cl", "straighten"): Hot("VW", "sample"),
    ("ray_casting.cl", "hidden"): Hot("1", "node of the tree and ray"),
    ("spectral_echo.cl", "spread"): Hot("1", "scatterer and tile of the grid", loop="barrier", trips=("64",)),
    ("spread_facets.cl", "facet_amplitudes"): Hot("VW", "pulse node, facet and frequency"),
    ("spread_facets.cl", "spread_facets"): Hot("VW", "pulse and facet", loop="around", trips=("1",)),
    # each item brings a scatterer; the loop inside adds those of the group up, and runs again where a window moves
    ("spread_points.cl", "spread"): Hot("VW", "pulse and scatterer", loop="around", trips=("1",)),
}


@dataclass(frozen=True)
class Cost:
    """Instructions of one trip of a hot loop, in all and by kind, and the contributions that a trip makes."""

    trip: float
    contributions: float
    unit: str
    by_kind: dict[str, float]

    @property
    def each(self) -> float:
        """Instructions per contribution."""
        return self.trip / self.contributions


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
    if which == "innermost":
        loops = [loop for loop in loops if not loop.inside]
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
        if hot:
            raise NotCounted(f"no loop of the kind {hot.loop!r} is there; found: {described(code) or 'no loop at all'}")
        return Cost(len(code.opcodes), 1.0, "work-item", {k: float(v) for k, v in kinds(code.opcodes).items()})
    if hot is None:
        found = kinds(code.own(loop))
        return Cost(len(code.own(loop)), 1.0, "trip", {k: float(v) for k, v in found.items()})
    inner = inside(loop)
    if len(inner) != len(hot.trips):
        raise NotCounted(
            f"trips of {len(hot.trips)} loops inside the hot one are known, {len(inner)} are there; "
            f"found: {described(code)}; write their trips in tests/gpu_static/hot_loops.py"
        )
    values = {**macros}
    trips = {id(loop): 1.0}
    given = dict(zip(map(id, inner), hot.trips, strict=True))
    total: dict[str, float] = {}
    todo = [loop]
    while todo:
        here = todo.pop(0)
        for name, count in kinds(code.own(here)).items():
            total[name] = total.get(name, 0.0) + count * trips[id(here)]
        for child in here.inside:
            trips[id(child)] = trips[id(here)] * float(eval(given[id(child)], {}, values))
            todo.append(child)
    each = float(eval(hot.contributions, {}, values))
    return Cost(sum(total.values()), each, hot.unit, total)


def inside(loop: Loop) -> list[Loop]:
    """Every loop inside a loop: by address, those inside them right after each."""
    return [found for child in loop.inside for found in (child, *inside(child))]

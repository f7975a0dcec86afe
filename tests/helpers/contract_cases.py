"""Random tasks over everything the accuracy contract covers, each from one seed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import sarcl

C = 299792458.0
DATA = ("noise", "band edge", "bright point", "noise", "one pixel", "one pulse")
TRACKS = ("line", "circle", "bumpy", "scattered")


@dataclass(frozen=True)
class Case:
    """What is drawn: see `draw`."""

    seed: int
    distance: float
    center: float
    bandwidth: float
    squint: float
    bistatic: bool
    extent: float
    track: str
    data: str
    n_rows: int
    n_samples: int
    side: int
    tolerance: float
    fp64: bool


def draw(seed: int, terms: float = 3e6, lowest: float = -6.0) -> Case:
    """Case number `seed`: at most `terms` terms in the exact sum, tolerances from 10^lowest to 0.1."""
    random = np.random.default_rng(1000 + seed)

    def log(low: float, high: float) -> float:
        return float(np.exp(random.uniform(np.log(low), np.log(high))))

    distance, center = log(1.0, 36e6), log(1e8, 1e11)
    data = DATA[seed % len(DATA)]
    n_rows = 1 if data == "one pulse" else int(random.integers(2, 40))
    side = 1 if data == "one pixel" else int(random.integers(2, 65))
    most = max(2, int(min(65536, terms / (n_rows * min(side * side, 300)))))
    return Case(
        seed=seed,
        distance=distance,
        center=center,
        bandwidth=center * log(0.01, 0.6),
        squint=float(random.uniform(-1, 1)) * np.pi / 3,
        bistatic=bool(random.integers(2)),
        extent=min(log(1.0, 1e5), 2 * distance),
        track=TRACKS[random.integers(len(TRACKS))],
        data=data,
        n_rows=n_rows,
        n_samples=int(min(most, max(1, log(1, 65536)))),
        side=side,
        tolerance=float(10 ** random.uniform(lowest, -1)),
        fp64=bool(random.integers(2)),
    )


def build(case: Case) -> tuple[sarcl.PhaseHistory, sarcl.ImageGrid]:
    """The echoes and the grid of a case."""
    random = np.random.default_rng(case.seed)
    n, d = case.n_rows, case.distance
    t = np.linspace(-0.5, 0.5, n) if n > 1 else np.zeros(1)
    along = np.stack([np.zeros(n), np.ones(n), np.zeros(n)], axis=1) * (t * d * 0.1)[:, None]
    middle = d * np.array([-0.75 * np.cos(case.squint), 0.75 * np.sin(case.squint), 0.66])
    if case.track == "circle":
        angle = 0.3 * t
        tx = np.stack([middle[0] * np.cos(angle), middle[0] * np.sin(angle), np.full(n, middle[2])], axis=1)
    elif case.track == "scattered":
        tx = middle + random.standard_normal((n, 3)) * d * 0.05
    else:
        tx = middle + along
        if case.track == "bumpy":
            tx = tx + np.sin(np.outer(t, [7, 9, 11]) * 3 + random.uniform(0, 6, 3)) * d * 0.002
    rx = tx @ np.diag([1, -0.6, 0.8]) + d * np.array([0.05, 0.3, 0.1]) if case.bistatic else None
    back = tx if rx is None else rx
    center = random.standard_normal(3) * case.extent * 0.02
    reference = (np.linalg.norm(tx - center, axis=1) + np.linalg.norm(back - center, axis=1)) / 2
    step = case.bandwidth / case.n_samples
    f = case.center - case.bandwidth / 2 + step * np.arange(case.n_samples)
    shape = (n, case.n_samples)
    if case.data == "band edge":
        samples = np.zeros(shape, complex)
        samples[:, 0 if case.seed % 4 else -1] = np.exp(2j * np.pi * random.uniform(size=n))
    elif case.data == "bright point":
        samples = np.exp(-2j * np.pi * np.outer(random.uniform(-0.3, 0.3, n), np.arange(case.n_samples)))
    else:
        samples = random.standard_normal(shape) + 1j * random.standard_normal(shape)
    raw = sarcl.PhaseHistory(
        samples.astype(np.complex64), frequency=f[0], frequency_step=step, tx=tx, rx=rx, reference_range=reference
    )
    # as many pixels as the window contains, at any extent: otherwise most would be outside it
    window = C / (2 * step)
    spacing = min(case.extent, 1.5 * window) / case.side
    angle = random.uniform(0, 2 * np.pi)
    grid = sarcl.ImageGrid.plane(
        center=center, shape=(case.side, case.side), spacing=spacing, x_axis=(np.cos(angle), np.sin(angle), 0)
    )
    if case.seed % 5 == 0 and case.side > 1:
        bumps = grid.positions + random.standard_normal((case.side, case.side, 3)) * spacing * 0.2
        grid = sarcl.ImageGrid.points(bumps)
    return raw, grid

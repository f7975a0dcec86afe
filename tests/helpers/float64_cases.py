"""Float64 backprojection run by itself, and the exact sum it is held against."""

from __future__ import annotations

from decimal import Decimal, getcontext

import numpy as np

from sarcl.base.constants import SPEED_OF_LIGHT
from sarcl.base.stage_timer import Clock
from sarcl.imaging.engine import Skipped
from sarcl.imaging.float64.direct import DirectFloat64
from sarcl.imaging.float64.plan import make_plan
from sarcl.imaging.focusing_task import FocusingTask, beam_of, geometry_of


def task_of(raw, grid, *, wrap=False, skips=("range window", "beam"), samples=None, rows=None, beam=None):
    samples = np.ones(raw.n_samples) if samples is None else samples
    rows = np.ones(raw.n_rows) if rows is None else rows
    toward, angle = beam_of(raw, beam, grid.bounds.mean(axis=0))
    return FocusingTask(raw, grid, geometry_of(raw, wrap, toward, angle), samples, rows, wrap, frozenset(skips))


def focus(raw, grid, tolerance, device, *, budget=2.0**28, plan=None, **options):
    """Image, plan and pairs skipped: outside the range window; with a beam (those, outside the beam)."""
    task = task_of(raw, grid, **options)
    made, tiling = make_plan(task, tolerance)
    engine = DirectFloat64(device, task, plan or made, tiling)
    flat = np.full(grid.shape if grid.is_plane else grid.size, np.nan, engine.dtype)
    fills = (engine.fill(a, b, flat, budget, Clock(), lambda rows: None) for a, b in engine.blocks(budget))
    skipped = sum(fills, Skipped())
    counts = skipped.window if options.get("beam") is None else (skipped.window, skipped.beam)
    return flat.reshape(grid.shape), made, counts


def decimal_image(raw, points, wrap=False):
    """The image equation with paths of 50 digits: longdouble has an error of 1e-9 rad at 36 000 km, X band."""
    getcontext().prec = 50
    tx, rx = ([[Decimal(float(v)) for v in row] for row in ends] for ends in (raw.tx, raw.rx))
    n = np.arange(raw.n_samples) - raw.n_samples // 2
    image, power = np.zeros(len(points), np.complex128), 0.0
    for i, point in enumerate(points):
        x = [Decimal(float(v)) for v in point]
        for p in range(raw.n_rows):
            path = sum(
                sum((a - b) ** 2 for a, b in zip(end, x, strict=True)).sqrt() for end in (tx[p], rx[p])
            ) - 2 * Decimal(float(raw.reference_range[p]))
            delay = path / Decimal(SPEED_OF_LIGHT)
            step = Decimal(float(raw.frequency_step[p]))
            if not wrap and abs(delay) > 1 / (2 * step):
                continue
            carrier = Decimal(float(raw.frequency[p])) + raw.n_samples // 2 * step
            turns = float(carrier * delay % 1) + float(step * delay % 1) * n
            profile = (np.exp(2j * np.pi * turns) * raw.read(p, p + 1)[0]).sum()
            image[i] += profile
            power += abs(profile) ** 2
    return image, float(np.sqrt(power))


def error(data, raw, grid, wrap=False, most=40):
    """L2 error at up to `most` pixels, relative as the accuracy contract says."""
    picked = np.random.default_rng(0).permutation(grid.size)[:most]
    wanted, spread = decimal_image(raw, grid.positions.reshape(-1, 3)[picked], wrap)
    return np.linalg.norm(np.asarray(data).ravel()[picked] - wanted) / max(np.linalg.norm(wanted), spread)

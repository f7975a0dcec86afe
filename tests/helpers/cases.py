"""Echoes, grids, errors and a scenario that several tests share."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import sarcl
from sarcl.reference.backproject import backproject as exact_image

# further partners of values that have quick ones: run with -m slow, on the devices themselves (tests/conftest.py)
REPEATED = (pytest.mark.slow, pytest.mark.repeated)

# a scenario file that simulates two points from an arc
SCENARIO = """\
[waveform.chirp]
center = 9.6e9
bandwidth = 300e6
duration = 1e-6

[trajectory.circle]
radius = 7e3
height = 5e3
arc = 0.03
n_pulses = 48

[[scene.points]]
positions = [[0, 0, 0], [3, 2, 0]]
amplitudes = [1, 0.1]
"""


def noise_on(tx, rx=None, *, center=9.6e9, bandwidth=300e6, n_samples=96, seed=0, **fields):
    """White noise in every sample, on any track, so that no error cancels by alignment. Ranges are from the origin."""
    random = np.random.default_rng(seed)
    shape = (len(tx), n_samples)
    samples = random.standard_normal(shape) + 1j * random.standard_normal(shape)
    back = tx if rx is None else rx
    return sarcl.PhaseHistory(
        samples.astype(np.complex64),
        frequency=center - bandwidth / 2,
        frequency_step=bandwidth / n_samples,
        tx=tx,
        rx=rx,
        reference_range=(np.linalg.norm(tx, axis=1) + np.linalg.norm(back, axis=1)) / 2,
        **fields,
    )


def noise_history(*, n_rows=40, distance=10e3, bistatic=False, arc=0.07, seed=0, **fields):
    """White noise on a slightly random arc at `distance`."""
    random = np.random.default_rng(seed)
    angle = arc * (np.arange(n_rows) / max(n_rows - 1, 1) - 0.5)
    tx = distance * np.stack([0.7 * np.cos(angle), 0.7 * np.sin(angle), np.full(n_rows, 0.714)], axis=1)
    tx += random.standard_normal((n_rows, 3)) * min(1.0, distance / 100)
    rx = tx + distance * np.array([0.1, 0.2, 0.0]) if bistatic else None
    return noise_on(tx, rx, seed=random, **{"bandwidth": 600e6, "n_samples": 48, **fields})


def straight(n, aperture=60.0, distance=10e3, squint=0.0):
    """A straight flight line, m (n, 3), its middle `squint` rad from broadside."""
    y = aperture * (np.arange(n) / (n - 1) - 0.5) + distance * 0.7 * np.tan(squint)
    return np.stack([np.full(n, -0.7 * distance), y, np.full(n, 0.714 * distance)], axis=1)


def image_error(image, raw, *, most=None, among=None, exact=exact_image, **model):
    """L2 error of an image, relative to the exact sum as the accuracy contract says.

    most   pixels, picked at random, and `among` which, flat indices; by default all
    model  wrap, weights and beam, as `exact` takes them. Where the sum and all of its parts are zero the error is what
    the image has instead.
    """
    at = np.arange(image.grid.size) if among is None else among
    at = at if most is None else np.random.default_rng(5).choice(at, min(most, len(at)), replace=False)
    wanted, random_norm = exact(raw, image.grid.positions.reshape(-1, 3)[at], **model)
    scale = max(np.linalg.norm(wanted), random_norm)
    return float(np.linalg.norm(np.asarray(image.data).ravel()[at] - wanted) / (scale or 1.0))


def planned_within(limits, verb, *subjects, **options):
    """The plan of a verb of echoes for these arguments, with other values of fields of EchoLimits; "host" as one of
    them: bytes for facets that are cut."""
    plan = verb.planned(*subjects, **options)
    request, limits = plan.task.request, dict(limits)
    request = replace(request, host=limits.pop("host", request.host))
    request = replace(request, limits=replace(request.limits, **limits))
    return replace(plan, task=replace(plan.task, request=request))


def quick_of(quick, values):
    """`values` as parameters; those that are not in `quick` are slow."""
    return [pytest.param(*_tuple(value), marks=[] if value in quick else pytest.mark.slow) for value in values]


def thinned(first, second, every=2, slow=None):
    """Pairs of two lists as parameters, their tuples flattened; the quick ones lie `every` apart along both lists.

    Each value has quick partners, so each formula and kernel that one of them chooses is run, on each device and its
    twins. The other pairs are REPEATED: all of them, or those that lie as far from a quick one as `slow` lists.
    """
    slow = range(1, every) if slow is None else slow
    pairs = [((i + j) % every, *_tuple(a), *_tuple(b)) for i, a in enumerate(first) for j, b in enumerate(second)]
    return [
        pytest.param(*values, marks=REPEATED if away else []) for away, *values in pairs if away == 0 or away in slow
    ]


def _tuple(value):
    return value if isinstance(value, tuple) else (value,)

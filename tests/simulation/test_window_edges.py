"""Facets on which a range window ends: the part inside counts, however finely facets are cut."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.cases import quick_of

import sarcl

F0, BAND, FAR = 3e9, 150e6, 1e6  # Hz, Hz, m: from so far a range window ends along a straight line
WINDOW = (-1.5, 1.2)  # m
PULSES = 3


def track(azimuth: float, elevation: float) -> sarcl.Trajectory:
    """Three places far away, seen at almost the same angles."""
    turn = azimuth + np.linspace(-1e-9, 1e-9, PULSES)
    look = np.stack([np.cos(turn) * np.cos(elevation), np.sin(turn) * np.cos(elevation), turn * 0 + np.sin(elevation)])
    return sarcl.Trajectory(np.arange(PULSES) * 0.01, FAR * look.T)


def rectangle(x: tuple[float, float], y: tuple[float, float], z: float = 0.0) -> np.ndarray:
    """Two triangles, m (2, 3, 3)."""
    a, b, c, d = ((x[i], y[j], z) for i, j in ((0, 0), (1, 0), (1, 1), (0, 1)))
    return np.array([[a, b, c], [a, c, d]])


def echo(triangles: np.ndarray, window: tuple[float, float], tolerance: float, **options: object) -> np.ndarray:
    """Echoes about the origin, at the frequencies of WINDOW."""
    chirp = sarcl.Waveform.chirp(center=F0, bandwidth=BAND, duration=1e-6)
    tx, elevation = options.pop("tx", 0.0), 0.6
    raw = sarcl.echo(
        sarcl.Scene.facets(triangles),
        chirp,
        track(float(str(tx)), elevation),
        reference=(0, 0, 0),
        range_window=window,
        tolerance=tolerance,
        **options,
    )
    return np.asarray(raw.samples)


def trimmed(look: np.ndarray) -> tuple[float, float]:
    """x of a plate at z = 0, m, at which WINDOW ends, for half the sum of the looks, without a part along y."""
    assert abs(look[1]) < 1e-12
    return -WINDOW[1] / look[0], -WINDOW[0] / look[0]


@pytest.mark.parametrize("tolerance", quick_of([1e-1], [1e-1, 1e-3]))
@pytest.mark.parametrize("other", quick_of([0.5], [None, 0.5]))
def test_the_part_inside_the_window_counts(tolerance: float, other: float | None) -> None:
    """A plate that the window ends on is the plate that is trimmed there, seen by one antenna or by two."""
    turn = 0.0 if other is None else other
    receiver = {} if other is None else {"receiver": track(turn, 0.6)}
    look = np.array([np.cos(turn) * np.cos(0.6), 0, np.sin(0.6)])
    x = trimmed(look)
    whole = echo(rectangle((-6, 5), (-1, 2)), WINDOW, tolerance, tx=-turn, **receiver)
    inside = echo(rectangle(x, (-1, 2)), tuple(1.0000001 * np.array(WINDOW)), tolerance / 20, tx=-turn, **receiver)
    assert whole.shape == inside.shape
    assert np.linalg.norm(whole - inside) < tolerance * np.linalg.norm(inside)


@pytest.mark.parametrize("tolerance", quick_of([1e-1], [1e-1, 1e-3]))
def test_a_shadow_and_the_window_end_on_one_facet(tolerance: float) -> None:
    """A smaller plate above the larger one hides a part of it across the window's edge, and is outside itself."""
    x, height = trimmed(np.array([np.cos(0.6), 0, np.sin(0.6)])), 6.0
    shift = height / np.tan(0.6)
    shade = rectangle((x[0] + shift - 1.0, x[0] + shift + 0.8), (-0.5, 0.6), height)  # its shadow is there, less shift
    whole = echo(np.concatenate([rectangle((-6, 5), (-1, 2)), shade]), WINDOW, tolerance)
    wide = tuple(1.0000001 * np.array(WINDOW))
    inside, hidden = (
        echo(rectangle(*sides), wide, tolerance / 20, shadows=False)
        for sides in ((x, (-1, 2)), ((x[0], x[0] + 0.8), (-0.5, 0.6)))
    )
    assert np.linalg.norm(whole - (inside - hidden)) < tolerance * np.linalg.norm(inside - hidden)
    assert np.linalg.norm(hidden) > 0.3 * np.linalg.norm(inside)


def test_a_facet_reaches_into_the_window() -> None:
    """The centroid of the only facet is outside; the corner inside counts, and the check agrees."""
    triangle = np.array([[[-8.0, -1, 0], [-8, 1, 0], [0.5, 0, 0]]])
    chirp = sarcl.Waveform.chirp(center=F0, bandwidth=BAND, duration=1e-6)
    raw = sarcl.echo(
        sarcl.Scene.facets(triangle),
        chirp,
        track(0, 0.6),
        reference=(0, 0, 0),
        range_window=WINDOW,
        check=True,
        tolerance=1e-3,
    )
    x, _ = trimmed(np.array([np.cos(0.6), 0, np.sin(0.6)]))
    half = (0.5 - x) / 8.5
    corner = np.array([[[x, -half, 0], [x, half, 0], [0.5, 0, 0]]])
    inside = echo(corner, tuple(1.0000001 * np.array(WINDOW)), 1e-5)
    assert np.linalg.norm(np.asarray(raw.samples) - inside) < 1e-3 * np.linalg.norm(inside)
    assert raw.report.measured_error is not None and raw.report.measured_error < 1e-3

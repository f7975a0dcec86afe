"""Secular drift by the Earth's oblateness, against Lagrange's planetary equations with an averaged potential."""

from __future__ import annotations

import numpy as np
import pytest

from sarcl.earth.kepler import KeplerElements

GM, RADIUS, J2 = 3.986004418e14, 6378137.0, 1.08262668e-3


def averaged(a, e, i):
    """Mean over a revolution of the disturbing potential of J2, m^2/s^2 (perigee at the node: it does not matter)."""
    n = 512
    mean = 2 * np.pi * (np.arange(n) + 0.5) / n
    eccentric = mean.copy()
    for _ in range(50):
        eccentric = eccentric - (eccentric - e * np.sin(eccentric) - mean) / (1 - e * np.cos(eccentric))
    r = a * (1 - e * np.cos(eccentric))
    true = 2 * np.arctan2(np.sqrt(1 + e) * np.sin(eccentric / 2), np.sqrt(1 - e) * np.cos(eccentric / 2))
    sine = np.sin(i) * np.sin(true)  # of the latitude
    return float((-GM * J2 * RADIUS**2 / r**3 * (1.5 * sine**2 - 0.5)).mean())


@pytest.mark.parametrize(("a", "e", "i"), [(7.1e6, 0.05, 1.7), (2.66e7, 0.7, 1.1), (1.2e7, 0.4, 0.6)])
def test_rates_are_those_of_lagrange_s_equations(a, e, i):
    def slope(of, at):
        h = 1e-4 * at
        return (of(at + h) - of(at - h)) / (2 * h)

    by_a = slope(lambda x: averaged(x, e, i), a)
    by_e = slope(lambda x: averaged(a, x, i), e)
    by_i = slope(lambda x: averaged(a, e, x), i)
    n, shape = np.sqrt(GM / a**3), 1 - e**2
    node = by_i / (n * a**2 * np.sqrt(shape) * np.sin(i))
    perigee = np.sqrt(shape) * by_e / (n * a**2 * e) - np.cos(i) * node
    anomaly = n - shape * by_e / (n * a**2 * e) - 2 * by_a / (n * a)
    made = KeplerElements(a, e, i, 0.0, 0.0, 0.0, 0.0, True).rates
    assert made[0] == pytest.approx(node, rel=1e-4)
    assert made[1] == pytest.approx(perigee, rel=1e-4)
    assert made[2] - n == pytest.approx(anomaly - n, rel=1e-4)

"""Antennas of every kind, for tests of their patterns on the host and on devices."""

from __future__ import annotations

import numpy as np

from sarcl.model.antenna import Antenna

FC = 9.6e9


def measured(step_deg=0.5, reach_deg=12.0, **options):
    """A smooth complex pattern as a table, and the function it samples."""
    axis = np.deg2rad(np.arange(-reach_deg, reach_deg + 1e-9, step_deg))

    def shape(a, e):
        return np.exp(-((a / 0.08) ** 2) - (e / 0.1) ** 2 + 3j * a * e / 0.01 + 2j * e)

    return Antenna.table(axis, axis, shape(axis[:, None], axis), **options), shape


def everyone():
    return {
        "isotropic": Antenna.isotropic(),
        "aperture": Antenna.rectangular(size=(0.4, 0.2)),
        "tapered": Antenna.rectangular(size=(0.4, 0.2), taper=(0.08, 0.3)),
        "gaussian": Antenna.gaussian(width=(0.05, 0.12)),
        "wide gaussian": Antenna.gaussian(width=1.2, frequency=FC / 1.1),
        "table": measured()[0],
        "table that shrinks": measured(frequency=FC * 1.1)[0],
    }

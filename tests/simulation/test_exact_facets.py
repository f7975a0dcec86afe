"""Few facets in few pulses and samples, added up in float64 on the host."""

from __future__ import annotations

import numpy as np
from helpers.facet_cases import plate, seen_from

import sarcl
from sarcl.base.stage_timer import Clock
from sarcl.numerics.pulse_geometry import PulseGeometry
from sarcl.reference import facet
from sarcl.scattering.antenna_weights import AntennaWeights
from sarcl.scattering.facet_plan import FacetPlan
from sarcl.scattering.facets import FacetSet
from sarcl.simulation.facets.exact_facets import ExactFacets
from sarcl.simulation.spreading import ChannelView


def test_sums_in_float64_are_those_of_the_reference_and_count_what_is_seen():
    shifts = np.array([[0, 0, 0], [0.3, -0.2, 0.1], [0, 0, 50]])
    triangles = np.concatenate([0.02 * plate(1.0, 0.3) + shift for shift in shifts])
    triangles[0] = triangles[0][::-1]  # faces away
    scene = sarcl.Scene.facets(triangles, two_sided=False)
    frequencies = 9.6e9 + 1e6 * np.arange(4)
    ends = np.stack([seen_from(9e3, 0.5, a) for a in (0.0, 0.1)])
    reference = np.linalg.norm(ends, axis=1)
    antennas = PulseGeometry.sampled(
        ends, ends, reference, first=frequencies[0], step=1e6, n_samples=4, window=(-5.0, 5.0)
    )
    part = FacetSet(
        scene.triangles, scene.reflectivity, scene.two_sided, scene.material, scene.materials, None, np.arange(6),
        np.zeros(0, np.complex64),
    )  # fmt: skip
    plan = FacetPlan(1.0, frequencies[:1], 1e-4, 6.0, is_float64=True)
    names, vertical = ("HH", "VV"), np.array([0.0, 0, 1])
    view = ChannelView(antennas, AntennaWeights(antennas, 9.6e9), frequencies, 0.0, names, vertical, gated=True)
    spreader = ExactFacets(part, plan, view)
    samples = np.zeros((2, 2, 4), np.complex64)
    counts = spreader.add(samples, range(2), Clock(), lambda n: None)
    for p in range(2):
        exact = facet.facet_echo(
            triangles[1:4], np.inf, frequencies, ends[p], ends[p], float(reference[p]), by_facet=True
        )
        for i in range(2):
            assert np.linalg.norm(samples[p, i] - exact[:, i, i]) <= 1e-5 * np.linalg.norm(exact[:, i, i])
    assert (counts.pairs, counts.outside_window, counts.facing_away, counts.contributing) == (12, 4, 2, 6)

"""Amplitudes of facets on the device against those in float64."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.cases import thinned

import sarcl
from sarcl import pointing
from sarcl.numerics.pulse_geometry import PulseGeometry
from sarcl.scattering.antenna_weights import weights_of
from sarcl.scattering.facet_shadows import ShadowRule
from sarcl.scattering.physical_optics import normals_and_areas
from sarcl.scattering.random_surface import pieces_of
from sarcl.scattering.scatterers import facets_of
from sarcl.scattering.subdivision import CutScene
from sarcl.simulation.spectral import _facet_factors as factors
from sarcl.simulation.spectral._scatterer_amplitudes import ScattererAmplitudes
from sarcl.simulation.spectral._straight_track import straight_track

CHIRP = sarcl.Waveform.chirp(center=9.6e9, bandwidth=150e6, duration=2e-6)
MATERIALS = {
    "metal": "metal",
    "dispersive": sarcl.Material(eps_r=4.0, conductivity=0.5),
    "rough": sarcl.Material(eps_r=4.0, conductivity=1e-3, diagram="cos2"),
    "slightly rough": sarcl.Material(eps_r=9.0, conductivity=1e-3, height=2e-3, diagram="exp", width=0.5),
}
ANTENNAS = {
    "none": (None, None),
    "gaussian": (sarcl.Antenna.gaussian(width=(0.02, 0.1)), sarcl.Radar(power=1e3)),
    "two": (
        (sarcl.Antenna.rectangular(size=(0.5, 0.1)), sarcl.Antenna.table(
            np.linspace(-0.1, 0.1, 9), np.linspace(-0.2, 0.2, 7), np.outer(np.hanning(11)[1:-1], np.ones(7)))),
        None,
    ),
}  # fmt: skip


@pytest.mark.parametrize("material, antenna", thinned(MATERIALS, ANTENNAS))
def test_factors_of_facets_are_their_amplitudes(material, antenna, every_device):
    line = sarcl.Trajectory.line(start=(0, -60, 6e3), velocity=(0, 100, 0), prf=250, n_pulses=40)
    track = pointing.stripmap(line, look=float(np.arctan2(8e3, 6e3)), side="right")
    axis = np.linspace(-6, 6, 9)
    heights = np.random.default_rng(1).normal(size=(9, 9)) * 0.3
    scene = sarcl.Scene.from_heights(8e3 + axis, axis, heights, material=MATERIALS[material])
    scene = scene + sarcl.shapes.box((2, 2, 3), material="metal").on(scene, 8e3, 0)
    antennas = PulseGeometry(track.positions, track.positions)
    (facets,), _ = facets_of(
        CutScene(scene, None, pieces_of(scene, np.inf, np.inf, 0)), antennas,
        shadows=ShadowRule(False, True, 1e-2, max_bytes=1e9), skips={"facing away"},
        device=every_device, progress=lambda *_: None,
    )  # fmt: skip
    weights = weights_of(*ANTENNAS[antenna], track, None, CHIRP, scene.center)
    polarizations = ("HH", "HV", "VH", "VV")
    amplitudes = ScattererAmplitudes(
        facets, weights, straight_track(track, 1e10, 1e-3), polarizations, np.array([0.0, 0.0, 1.0])
    )
    some = np.flatnonzero(np.random.default_rng(2).random(len(facets)) < 0.8)
    for budget in (1e9, 1.0):
        held = factors.FacetFactors(every_device, amplitudes, some, budget, at_once=100)
        for sine, frequency in ((-0.004, 9.55e9), (0.003, 9.67e9)):
            wanted = amplitudes(some, sine, frequency)
            found = held(sine, frequency)
            assert found.dtype == np.complex64 and found.shape == wanted.shape
            areas = normals_and_areas(facets.triangles[some])[1]
            peak = np.sqrt(np.pi) * frequency / 3e8 * areas * 2.1 * weights.peak
            assert (np.abs(found - wanted).max(axis=1) <= 1e-5 * peak).all()
            # facets of 50 wavelengths, most of them far from their specular directions
            assert np.linalg.norm(found - wanted) <= 6e-5 * np.linalg.norm(wanted)

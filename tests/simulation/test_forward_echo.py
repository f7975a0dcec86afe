"""echo(forward=True): what a receiver behind a body gets, against rcs; what is refused, and what stays as it is."""

from __future__ import annotations

import numpy as np
import pytest

import sarcl
from sarcl import shapes

CHIRP = sarcl.Waveform.chirp(center=3e9, bandwidth=50e6, duration=1e-6)
FAR = 1e7  # m, of both antennas
AZIMUTH, ELEVATION = np.linspace(0.3, 3.2, 12), np.linspace(-0.2, 0.25, 12)


def towards(azimuth, elevation):
    return np.stack(
        [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)], axis=-1
    )


TX = sarcl.Trajectory(None, np.tile(FAR * towards(np.array(0.1), np.array(0.35)), (12, 1)))
RX = sarcl.Trajectory(None, FAR * towards(AZIMUTH, ELEVATION))
SCENE = shapes.box((1.0, 0.7, 0.5)) + shapes.plate((1.5, 1.5), position=(0, 0, -0.4), material="concrete")


@pytest.mark.parametrize("shadows", [True, False])
def test_it_is_the_field_of_rcs_at_all_bistatic_angles(device, shadows):
    raw = sarcl.echo(
        SCENE, CHIRP, TX, receiver=RX, reference=(0, 0, 0), forward=True, shadows=shadows, tolerance=1e-4, check=True,
        polarization="VV", device=device,
    )  # fmt: skip
    frequencies = raw.frequency[0] + raw.frequency_step[0] * np.arange(raw.n_samples)
    s = sarcl.rcs(
        SCENE, 0.1, 0.35, frequencies, receiver=(AZIMUTH, ELEVATION), forward=True, shadows=shadows, polarization="VV"
    )
    assert np.linalg.norm(raw.samples - s) <= 3e-4 * np.linalg.norm(s)
    assert raw.report.measured_error <= 1e-4


def test_one_antenna_gets_the_same_bits():
    one, two = (sarcl.echo(SCENE, CHIRP, RX, forward=forward, tolerance=1e-2) for forward in (False, True))
    assert np.array_equal(one.samples, two.samples)


def test_wide_angles_without_it_are_warned_of():
    with pytest.warns(sarcl.SarclWarning, match="bistatic angles reach 1[0-9]+ deg, .*pass forward=True"):
        sarcl.echo(SCENE, CHIRP, TX, receiver=RX, tolerance=1e-2)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"array": sarcl.AntennaArray.linear(3, spacing=0.05)}, "not for an array"),
        ({"scene": shapes.box((1, 1, 1), roughness=0.1)}, "facet 0 has a random echo"),
        ({"edges": True}, "not computed together with edges=True; currents of edges .* infinite straight ahead"),
        ({"bounces": 2}, "not computed together with bounces=2; .* would count that shadow twice"),
        ({"method": "factorized"}, 'method="factorized" is not possible'),
    ],
)
def test_what_it_is_not_for_is_refused(options, message):
    with pytest.raises(ValueError, match=message):
        sarcl.echo(options.pop("scene", SCENE), CHIRP, TX, receiver=RX, forward=True, **options)

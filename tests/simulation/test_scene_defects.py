"""Facets that lie on one another, antennas inside bodies, and frequencies in another unit."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import sarcl
from sarcl import shapes
from sarcl.base.errors import NothingSeen

CHIRP = sarcl.Waveform.chirp(center=9.6e9, bandwidth=50e6, duration=1e-6)
TRACK = sarcl.Trajectory.line(start=(1e3, 0, 1e3), velocity=(0, 1, 0), prf=1.0, n_pulses=2)
BOX = shapes.box((1, 1, 1))
SHUFFLED = sarcl.Scene.facets(BOX.triangles[:, [1, 2, 0]], two_sided=np.zeros(12, bool))


def echo(scene: sarcl.Scene, track: sarcl.Trajectory = TRACK, **options: object) -> sarcl.PhaseHistory:
    return sarcl.echo(scene, CHIRP, track, tolerance=0.1, **options)


@pytest.mark.parametrize("twin", [BOX, SHUFFLED])
def test_facets_that_lie_on_others_are_counted_with_the_remedy(twin):
    with pytest.warns(sarcl.SarclWarning, match="12 facets .* facet [12][0-9] on facet [0-9]+:.*leave"):
        echo(BOX + twin)
    with pytest.warns(sarcl.SarclWarning, match="12 facets lie on others"):
        sarcl.rcs(BOX + twin, 0.0, 0.5, 9.6e9)


def test_one_facet_on_another_is_said_in_the_singular():
    scene = sarcl.Scene.facets(np.concatenate([BOX.triangles, BOX.triangles[:1]]), two_sided=np.zeros(13, bool))
    with pytest.warns(sarcl.SarclWarning, match="1 facet lies on another, such as facet 12 on facet 0:"):
        sarcl.rcs(scene, 0.0, 0.5, 9.6e9)


@pytest.mark.parametrize(
    "other",
    [
        shapes.box((1, 1, 1), position=(1, 0, 0)),  # they touch, back to back
        shapes.box((1, 1, 1), position=(0, 0, 1e-3)),
        shapes.box((0.5, 0.5, 0.5)),
    ],
)
def test_bodies_that_touch_or_nearly_coincide_are_not_warned_of(other):
    with warnings.catch_warnings():
        warnings.filterwarnings("error", message=".*lies? on ")
        warnings.filterwarnings("ignore", message="flat parts face")
        echo(BOX + other)


@pytest.mark.parametrize("bounces", [1, 2])
def test_an_antenna_inside_a_closed_body_is_named(bounces):
    room = shapes.box((10, 10, 10))
    inside = sarcl.Trajectory(None, room.center + np.array([[20.0, 0, 0], [1, 2, 1]]))
    with pytest.raises(NothingSeen, match=r"pulse 1 of the track, at .* is inside a closed body.*two_sided=True"):
        echo(room, inside, bounces=bounces)
    with pytest.raises(NothingSeen, match="pulse 1 of the receiver"):
        echo(room, TRACK, receiver=inside)
    beside = sarcl.Trajectory(None, room.center + np.array([[20.0, 0, 0]]))
    echo(room + shapes.box((1, 1, 1), position=(40, 0, 0)), beside)  # between two bodies


@pytest.mark.parametrize(
    "call",
    [
        lambda f: sarcl.rcs(BOX, 0.0, 0.5, f),
        lambda f: sarcl.rcs(BOX, 0.0, 0.5, [9.6e9, f]),
        lambda f: sarcl.Waveform.chirp(center=f, bandwidth=1.0, duration=1.0),
        lambda f: sarcl.Waveform.tone(center=f, duration=10.0),
        lambda f: sarcl.Antenna.gaussian(width=(0.1, 0.1), frequency=f),
        lambda f: shapes.trihedral_rcs(1.0, (1, 1, 1), f),
    ],
)
@pytest.mark.parametrize(
    ("frequency", "remedy"),
    [(9.6, "in GHz? Give 9.6e+09"), (9600.0, "in MHz? Give 9.6e+09"), (9.6e18, "counted twice")],
)
def test_frequencies_in_another_unit_are_refused_with_it(call, frequency, remedy):
    with pytest.raises(ValueError, match=r"carriers lie between 1e5 and 1e13 Hz: ") as refused:
        call(frequency)
    assert f"is {frequency:g} Hz" in str(refused.value) and remedy in str(refused.value)

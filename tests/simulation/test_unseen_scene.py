"""Scenes that no pulse can see are refused before anything is planned, and no scene that may be seen ever is."""

from __future__ import annotations

import numpy as np
import pytest

import sarcl
from sarcl import pointing
from sarcl.base.errors import NothingSeen, ToleranceUnreachable
from sarcl.numerics.pulse_geometry import PulseGeometry
from sarcl.scattering import subdivision
from sarcl.scattering.antenna_weights import weights_of
from sarcl.simulation import scene_plan

CHIRP = sarcl.Waveform.chirp(center=9.6e9, bandwidth=200e6, duration=1e-6)
ANGLES = np.radians(np.linspace(-3, 3, 31))
TABLE = sarcl.Antenna.table(ANGLES, ANGLES, np.exp(-np.add.outer(ANGLES**2, ANGLES**2) / 2 / np.radians(1) ** 2))
ANTENNAS = {
    "aperture": sarcl.Antenna.rectangular(size=(1.0, 0.5)),
    "gaussian": sarcl.Antenna.gaussian(width=(0.02, 0.03)),
    "table": TABLE,
    "isotropic": sarcl.Antenna.isotropic(),
    "gaussian and table": (sarcl.Antenna.gaussian(width=(0.02, 0.03)), TABLE),
}


def circle(n_pulses=40, aim=(0.0, 0.0, 0.0)):
    track = sarcl.Trajectory.circle(radius=800, height=600, arc=0.2, n_pulses=n_pulses, prf=100.0, center=(0, 0, 0))
    return pointing.spotlight(track, aim)


def hills(n=60):
    x = 2.0 * np.arange(n)
    return sarcl.Scene.from_heights(x, x, np.random.default_rng(0).random((n, n))).moved((-n, -n, 0))


@pytest.fixture
def no_planning(monkeypatch):
    def fail(*args, **options):
        raise AssertionError("planned before the scene was refused")

    monkeypatch.setattr(scene_plan, "error_of_weights", fail)
    monkeypatch.setattr(subdivision, "plan_facets", fail)


@pytest.mark.parametrize("name", ["aperture", "gaussian", "table", "gaussian and table"])
def test_a_scene_out_of_every_beam_is_refused_before_planning(no_planning, name):
    with pytest.raises(NothingSeen, match=r"wholly out of the beam: its centre is never less than 1\d\d deg"):
        sarcl.echo(hills(), CHIRP, circle(aim=(1600, 0, 1200)), antenna=ANTENNAS[name])


@pytest.mark.parametrize("window", [(-900.0, -300.0), (400.0, 900.0)])
def test_a_scene_outside_the_range_window_is_refused_before_planning(no_planning, window):
    with pytest.raises(NothingSeen, match=f"outside the range window of {window[0]:g} to {window[1]:g} m"):
        sarcl.echo(hills(), CHIRP, circle(), range_window=window)


def test_a_scene_in_the_beam_only_outside_the_window_is_refused_as_such(no_planning):
    scene = sarcl.Scene.points([[0, 0, 0], [900, 0, 0]])  # the first in the beam, the second in the window
    track = circle(aim=(0.0, 0.0, 0.0)).picked(slice(0, 1))
    near = float(np.linalg.norm(track.positions[0] - [900, 0, 0]) - np.linalg.norm(track.positions[0]))
    with pytest.raises(NothingSeen, match="no scatterer in the range window is ever in the beam"):
        sarcl.echo(scene, CHIRP, track, antenna=TABLE, range_window=(near - 5, near + 5), reference=(0, 0, 0))


@pytest.mark.parametrize("name", ANTENNAS)
def test_what_the_beam_and_the_window_reach_is_never_refused(name):
    random, seen, refused = np.random.default_rng(5), 0, 0
    request = sarcl.echo.planned(sarcl.Scene.points([[0.0, 0, 0]]), CHIRP, circle()).task.request
    for _ in range(100):
        scene = sarcl.Scene.points(random.uniform(-1, 1, (20, 3)) * 10 ** random.uniform(0, 3, 3))
        off = random.uniform(-1, 1, 3) * 10 ** random.uniform(0, 3)
        track = circle(6, aim=random.choice(scene.positions) + off)
        weights = weights_of(ANTENNAS[name], None, track, None, CHIRP, scene.center)
        near = random.uniform(-900, 300)
        antennas = PulseGeometry(
            track.positions, track.positions, reference_range=np.linalg.norm(track.positions, axis=1),
            near=np.full(6, near), far=np.full(6, near + 10 ** random.uniform(0, 3)),
        )  # fmt: skip
        lit = False
        for p in range(6):
            away = np.linalg.norm(scene.positions - track.positions[p], axis=1) - antennas.reference_range[p]
            inside = (away >= antennas.near[p]) & (away <= antennas.far[p])
            lit |= bool((inside & (weights.weights(scene.positions, p, CHIRP.center) != 0)).any())
        try:
            scene_plan.planned_scene(request, scene_plan.SeenScene(scene, scene, CHIRP, antennas, weights), ())
        except NothingSeen:
            assert not lit
            refused += 1
        except ToleranceUnreachable:  # gains too weak for float32
            pass
        seen += lit
    assert seen > 10 and refused > 10

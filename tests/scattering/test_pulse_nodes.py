"""Amplitudes that pulses share: what lies between nodes, within what samples promise, and counted alike."""

import numpy as np
import pytest
from helpers.cases import planned_within, thinned

import sarcl
from sarcl import pointing
from sarcl.model.antenna import Antenna
from sarcl.numerics.pulse_geometry import PulseGeometry
from sarcl.scattering import pulse_nodes
from sarcl.scattering.antenna_weights import AntennaWeights
from sarcl.scattering.facets import FacetSet
from sarcl.scattering.pulse_nodes import PulseNodes, every, spaced
from sarcl.scene.material import Material

CHIRP = sarcl.Waveform.chirp(center=9.6e9, bandwidth=600e6, duration=1e-6)
ROUGH = Material(eps_r=4.0, conductivity=1e-3, height=np.inf, diagram="cos")
BOTH = Material(eps_r=6.0, conductivity=0.1, height=0.002, diagram="exp", width=0.5)


def hills(n=20, material=ROUGH, edge=0.3, seed=1):
    axis = edge * (np.arange(n + 1) - n / 2)
    return sarcl.Scene.from_heights(
        axis, axis, np.random.default_rng(seed).normal(0, edge / 6, (n + 1, n + 1)), material=material
    )


def track(n=96, length=300.0):
    return sarcl.Trajectory.line(start=(-7e3, -length / 2, 7e3), velocity=(0, length, 0), prf=float(n), n_pulses=n)


def echo(*subjects, own=0.0, **options):
    """Echoes of few facets that share amplitudes; `own` as in EchoLimits.own_amplitudes."""
    return planned_within({"own_amplitudes": own}, sarcl.echo, *subjects, **options).run()


@pytest.mark.parametrize(("n", "spacing"), [(17, 4), (18, 4), (65, 16), (100, 8), (257, 64)])
def test_cubics_go_through_nodes_and_are_exact_for_cubics(n, spacing):
    nodes = spaced(n, spacing)
    assert nodes.pulses[0] == 0 and nodes.pulses[-1] == n - 1
    rows = np.arange(n)
    for start, stop in ((0, n), (n // 3, n // 2), (n - 1, n)):
        needed, which, shares = nodes.of(start, stop)
        assert len(np.unique(needed)) == len(needed) and shares.shape == (stop - start, 4)
        curve = (needed / n - 0.3) ** 3 - needed / n
        made = (shares * curve[which[:, :1] + np.arange(4)]).sum(axis=1)
        np.testing.assert_allclose(made, ((rows / n - 0.3) ** 3 - rows / n)[start:stop], atol=2e-6)
        apart = np.abs(needed[which[:, 1]] - rows[start:stop])
        assert (apart <= np.abs(needed[:, None] - rows[start:stop]).min(axis=0)).all()


def test_each_its_own():
    needed, which, shares = every(9).of(3, 7)
    assert needed.tolist() == [3, 4, 5, 6] and which.tolist() == [[i, i] for i in range(4)] and (shares == 1).all()
    assert isinstance(every(9), PulseNodes) and every(9).order == 1


@pytest.mark.parametrize("material, tolerance", thinned([ROUGH, BOTH, "metal"], [1e-2, 1e-3]))
def test_shared_amplitudes_keep_the_tolerance(device, material, tolerance):
    """Against the exact sum of every pulse's own amplitudes, in HH and HV, gains and shadows among them."""
    scene = hills(4, material, edge=0.2)
    tx = pointing.spotlight(track(), (0, 0, 0))
    options = {"polarization": ["HH", "HV"], "antenna": Antenna.gaussian(width=0.002), "device": device}
    raw = echo(scene, CHIRP, tx, tolerance=tolerance, check=True, **options)
    assert raw.report.plan["pulses per amplitude"] >= 4
    assert raw.report.measured_error <= raw.report.predicted_error <= tolerance


@pytest.mark.costly
def test_shared_or_not_the_same_echoes_and_counts(device):
    """A receiver of its own, a window that cuts, facets that turn away on the way, blocks that end anywhere."""
    scene = hills(8, BOTH, edge=0.4) + sarcl.Scene.facets(
        [[[-2.0, 0, 0], [2, 0, 0], [0, 0.02, 3]], [[0, 2, 0.0], [1, 2, 0], [1, 2.0, 2]]], material=ROUGH
    )
    tx = sarcl.Trajectory.line(start=(-300, -6e3, 4e3), velocity=(600, 300, 0), prf=100.0, n_pulses=70)
    rx = sarcl.Trajectory(tx.times, tx.positions + np.array([200.0, 300, -500]))
    made = []
    for worth in (0, 1e12):
        options = {"receiver": rx, "range_window": (-3, 20), "tolerance": 1e-3, "max_edge": 0.2, "device": device}
        made.append(echo(scene, CHIRP, tx, own=worth, polarization="all", **options))
    shared, own = made
    assert shared.report.plan["pulses per amplitude"] > 1 == own.report.plan["pulses per amplitude"]
    assert np.linalg.norm(shared.samples - own.samples) <= 1e-3 * np.linalg.norm(own.samples)
    assert shared.report.contributions_done == pytest.approx(own.report.contributions_done, rel=2e-3)
    sums = [r.contributions_done + sum(r.contributions_skipped.values()) for r in (shared.report, own.report)]
    assert sums[0] == sums[1]


def test_a_jumping_track_shares_nothing(device):
    """Neighbours in time that are far apart in space: every pulse has its own amplitudes, and the echo is right."""
    tx = track()
    order = np.random.default_rng(2).permutation(len(tx))
    jumping = sarcl.Trajectory(tx.times, tx.positions[order])
    raw = echo(hills(8), CHIRP, jumping, tolerance=1e-2, check=True, device=device)
    assert raw.report.plan["pulses per amplitude"] == 1
    assert raw.report.measured_error <= raw.report.predicted_error <= 1e-2


def test_no_flash_falls_between_nodes(device):
    """A plate that mirrors for three pulses of two hundred: nodes are denser than its flash, whatever samples say."""
    plate = sarcl.Scene.facets([[[-1.0, -1, 0], [1, -1, 0], [1, 1, 0]], [[-1.0, -1, 0], [1, 1, 0], [-1, 1, 0]]])
    tx = sarcl.Trajectory.line(start=(-900, 0, 6e5), velocity=(1800e2, 0, 0), prf=100 * 200.0, n_pulses=200)
    tx = sarcl.Trajectory(tx.times, tx.positions * (60, 1, 1))
    raw = echo(plate, CHIRP, tx, tolerance=1e-2, check=True, device=device)
    own = raw.report.plan["pulses per amplitude"]
    assert own == 1 or 2 * np.pi / 0.031 * 2 * own * 9e-4 * raw.report.plan["facet edges, m"] * 2 / 3 <= 1.01
    wanted = sarcl.echo(plate, CHIRP, tx, tolerance=1e-2, device=device)
    assert np.linalg.norm(raw.samples - wanted.samples) <= 1e-2 * np.linalg.norm(wanted.samples)


@pytest.mark.costly
def test_memory_for_amplitudes_keeps_to_the_budget(device):
    """Tiles in several calls, blocks of few pulses: the same echoes."""
    scene = hills(60)
    small, large = (
        sarcl.echo(scene, CHIRP, track(40), tolerance=1e-2, max_bytes=size, shadows=False, device=device)
        for size in (1e6, 1e9)
    )
    np.testing.assert_allclose(small.samples, large.samples, atol=1e-4 * np.abs(large.samples).max())


@pytest.mark.parametrize("tolerance", [2e-3, 2e-2])
def test_the_error_between_nodes_knows_how_h_and_v_turn_below_the_antenna(tolerance):
    """4000 facets under a track, seen by a receiver 40 deg off the vertical: 16 pulses apart, thrice the estimate."""
    random, n, names, up = np.random.default_rng(2), 4000, ("HH", "VV"), np.array([0.0, 0.0, 1.0])
    places = random.uniform((-100, -100, 0), (100, 100, 5), (n, 3))
    part = FacetSet(
        places[:, None] + 0.02 * random.normal(size=(n, 3, 3)), np.ones(n), np.ones(n, bool), np.zeros(n, int),
        (Material(),), None, np.arange(n), np.zeros(0),
    )  # fmt: skip
    tx = np.stack([np.linspace(-50, 50, 1001), np.zeros(1001), np.full(1001, 1e3)], axis=1)
    geometry = PulseGeometry(tx, np.broadcast_to([700.0, 300.0, 900.0], (1001, 3)))
    nodes = pulse_nodes.plan_pulse_nodes(part, AntennaWeights(geometry, 9.6e9), names, up, 9.6e9, tolerance, 0)
    assert (nodes.spacing > 1) == (tolerance > 1e-2)

    def sent(pulse):
        return part.amplitudes(geometry.tx[pulse], geometry.rx[pulse], np.array([9.6e9]), names, up)[0]

    wrong = right = 0.0
    for pulse in random.integers(0, 1001, 24).tolist():
        needed, which, factors = nodes.of(pulse, pulse + 1)
        near = needed[which[0, 0] :][: nodes.order]
        guess = sum(factor * sent(one) for factor, one in zip(factors[0].astype(float), near, strict=True))
        wrong, right = wrong + np.abs(guess - sent(pulse)) ** 2, right + np.abs(sent(pulse)) ** 2
    assert np.sqrt(wrong.sum() / right.sum()) <= nodes.error <= tolerance

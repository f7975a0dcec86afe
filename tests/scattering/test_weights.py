"""Antennas and the radar equation in echoes: against the exact sum, closed forms, and one another."""

import numpy as np
import pytest
from helpers.cases import REPEATED, thinned

import sarcl
from sarcl import pointing
from sarcl.base.constants import SPEED_OF_LIGHT
from sarcl.model.antenna import Antenna
from sarcl.model.antenna_pattern import two_way_gain
from sarcl.model.radar import Radar
from sarcl.reference.facet import facet_amplitude
from sarcl.reference.geometry import half_path

NARROW = sarcl.Waveform.chirp(center=9.6e9, bandwidth=60e6, duration=5e-6)
WIDE = sarcl.Waveform.chirp(center=3e9, bandwidth=1.2e9, duration=5e-6)
ANGLES = np.linspace(-0.4, 0.4, 41)
TABLE = Antenna.table(
    ANGLES, ANGLES, np.exp(-((ANGLES[:, None] / 0.06) ** 2) - (ANGLES / 0.1) ** 2 + 2j * ANGLES), frequency=3e9
)
ANTENNAS = {
    "aperture": Antenna.rectangular(size=(1.2, 0.3), taper=0.3, gain_db=32),
    "gaussian": Antenna.gaussian(width=(0.05, 0.2), gain_db=20),
    "table": TABLE,
    "two-way": Antenna.gaussian(width=0.06, frequency=9.6e9, two_way=True),
    "pair": (Antenna.gaussian(width=0.08), Antenna.rectangular(size=0.4)),
}


def track(n=24, height=3000.0, aim=(0.0, 0.0, 0.0)):
    made = sarcl.Trajectory.line(start=(-300, -4000, height), velocity=(100, 5, 0), prf=100 * n / 600, n_pulses=n)
    return pointing.spotlight(made, aim)


def points(n=40, size=150.0, seed=3):
    random = np.random.default_rng(seed)
    return sarcl.Scene.points(random.uniform(-size, size, (n, 3)) * (1, 1, 0.05))


def facets(n=30, size=150.0, edge=1.5, seed=4):
    """Triangles all over the place, turned more or less towards the antenna."""
    random = np.random.default_rng(seed)
    centers = random.uniform(-size, size, (n, 1, 3)) * (1, 1, 0.05)
    made = centers + random.normal(size=(n, 3, 3)) * (edge / 3)
    normal = np.cross(made[:, 1] - made[:, 0], made[:, 2] - made[:, 0])
    away = (normal * (0, -4000, 3000)).sum(axis=1) < 0
    made[away] = made[away][:, ::-1]
    return sarcl.Scene.facets(made)


def exact(scene, raw, antenna, radar, pulses, columns, tx, rx, fine):
    """Samples (pulses, columns), and the norm at random phases: centroids' plane waves of facets cut to `fine`, m."""
    from sarcl.model.antenna import pair_of

    pair = None if antenna is None else pair_of(antenna, rx is not tx)
    axes = None if pair is None else (pair[0].axes(tx), (pair[1] or pair[0]).axes(rx))
    cut = scene.split(fine) if len(scene.triangles) else scene
    places = np.concatenate([scene.positions, cut.triangles.mean(axis=1)])
    out, power = np.zeros((len(pulses), len(columns)), complex), 0.0
    for i, p in enumerate(pulses):
        ends = tx.positions[p], rx.positions[p]
        away = [np.linalg.norm(places - end, axis=1) for end in ends]
        delay = 2 / np.longdouble(SPEED_OF_LIGHT) * half_path(*ends, places, float(raw.reference_range[p]))
        for j, c in enumerate(columns):
            f = float(raw.frequency[p] + c * raw.frequency_step[p])
            to = [
                (end - cut.triangles.mean(axis=1)) / r[len(scene.positions) :, None]
                for end, r in zip(ends, away, strict=True)
            ]
            matrix = facet_amplitude(cut.triangles, np.inf, f, *to)[:, 0, 0]
            a = np.concatenate([scene.amplitudes, matrix])
            if pair is not None:
                a = a * two_way_gain(pair, (axes[0][p], axes[1][p]), *ends, places, f)
            if radar is not None:
                a = a / (away[0] * away[1]) * radar.factor(f)
            wave = np.exp(-2j * np.pi * ((np.longdouble(f) * delay) % 1).astype(float))
            weight = abs(raw.waveform.pulse_spectrum(np.array([f]))[0]) ** 2
            out[i, j] = (a * wave).sum() * weight
            power += (np.abs(a) ** 2).sum() * weight**2
    return out, np.sqrt(power)


def error(scene, raw, antenna, radar, tx, rx=None, fine=0.5):
    pulses, columns = np.arange(0, len(tx), 5), np.linspace(0, raw.n_samples - 1, 9).astype(int)
    wanted, norm = exact(scene, raw, antenna, radar, pulses, columns, tx, rx or tx, fine)
    got = raw.samples[pulses][:, columns]
    return np.linalg.norm(got - wanted) / max(np.linalg.norm(wanted), norm)


TOLERANCES = [1e-2, 1e-3, 1e-4]
AIMED = [(NARROW, (0, 0, 0)), (WIDE, (0, 0, 0)), (WIDE, (350, 200, 0))]


@pytest.mark.parametrize("kind, tolerance", thinned(ANTENNAS, TOLERANCES, every=3))
def test_points_keep_the_tolerance(device, kind, tolerance):
    """On boresight, and 6 deg off it, where some of these antennas have side lobes, 60 dB down."""
    # each antenna and each tolerance with each of them; not the last at the smallest tolerance
    which = (list(ANTENNAS).index(kind) + 2 * TOLERANCES.index(tolerance)) % 3
    waveform, aim = AIMED[min(which, 1) if tolerance == 1e-4 else which]
    scene, tx, antenna = points(), track(aim=aim), ANTENNAS[kind]
    raw = sarcl.echo(scene, waveform, tx, antenna=antenna, tolerance=tolerance, device=device)
    assert error(scene, raw, antenna, None, tx) <= raw.report.predicted_error <= tolerance


@pytest.mark.parametrize("kind, waveform", thinned(ANTENNAS, [NARROW, WIDE]))
def test_facets_keep_the_tolerance(device, kind, waveform):
    scene, tx, antenna = facets(), track(), ANTENNAS[kind]
    raw = sarcl.echo(
        scene, waveform, tx, antenna=antenna, radar=Radar(power=1e3), tolerance=1e-2, shadows=False, device=device
    )
    found = error(scene, raw, antenna, Radar(power=1e3), tx)
    assert found <= raw.report.predicted_error <= 1e-2


@pytest.mark.parametrize("kind", [pytest.param("aperture", marks=REPEATED), "pair"])
@pytest.mark.costly
def test_two_places_have_two_gains(device, kind):
    scene, tx = points() + facets(), track()
    rx = pointing.spotlight(sarcl.Trajectory(tx.times, tx.positions + np.array((900.0, -500, 400))), (30, 0, 0))
    antenna, radar = ANTENNAS[kind], Radar(power=10.0, losses_db=3)
    raw = sarcl.echo(
        scene, NARROW, tx, receiver=rx, device=device, antenna=antenna, radar=radar, tolerance=1e-2, shadows=False
    )
    found = error(scene, raw, antenna, radar, tx, rx)
    assert found <= raw.report.predicted_error <= 1e-2


def test_the_radar_equation(device):
    """P G^2 lambda^2 sigma/((4 pi)^3 R^4 L) of one point, to the rounding of its parts."""
    scene = sarcl.Scene.points([[0.0, 0, 0]], amplitudes=[3.0])
    tx, radar = track(n=4), Radar(power=2e3, losses_db=4)
    raw = sarcl.echo(
        scene, NARROW, tx, antenna=Antenna.isotropic(gain_db=30), radar=radar, tolerance=1e-4, device=device
    )
    middle = raw.n_samples // 2
    f = float(raw.frequency[0] + middle * raw.frequency_step[0])
    power = 2e3 * 1e3**2 * (SPEED_OF_LIGHT / f) ** 2 * 9 / ((4 * np.pi) ** 3 * 10**0.4)
    power = power / np.linalg.norm(tx.positions, axis=1) ** 4
    shape = np.abs(NARROW.pulse_spectrum(np.array([f])))[0] ** 2
    np.testing.assert_allclose(np.abs(raw.samples[:, middle]) ** 2, power * shape**2, rtol=1e-4)


def test_scanning_draws_the_pattern(device):
    """One point, an antenna that turns past it: the rows are the two-way pattern, aperture's nulls and all."""
    antenna = Antenna.rectangular(size=(1.0, 0.5))
    still = sarcl.Trajectory(np.arange(201.0), np.tile((0.0, -5000.0, 0.0), (201, 1)))
    turned = pointing.steered(pointing.spotlight(still, (0, 0, 0)), np.linspace(-0.1, 0.1, 201), 0.0)
    raw = sarcl.echo(sarcl.Scene.points([[0.0, 0, 0]]), NARROW, turned, antenna=antenna, tolerance=1e-4, device=device)
    middle = raw.n_samples // 2
    f = raw.frequency[0] + middle * raw.frequency_step[0]
    wanted = np.sinc(f / SPEED_OF_LIGHT * np.sin(np.linspace(-0.1, 0.1, 201))) ** 2
    shape = np.abs(NARROW.pulse_spectrum(np.array([f])))[0] ** 2
    np.testing.assert_allclose(np.abs(raw.samples[:, middle]), wanted * shape, atol=2e-5)


@pytest.mark.costly
def test_left_out_of_the_beam_changes_nothing(device):
    """A strip much longer than the beam: most pairs are skipped, and the samples are those of all of them."""
    random = np.random.default_rng(5)
    scene = sarcl.Scene.points(random.uniform(-1, 1, (6000, 3)) * (2000, 200, 2)) + facets(300, 600.0, edge=0.5)
    made = sarcl.Trajectory.line(start=(-1500, -4000, 3000), velocity=(100, 0, 0), prf=2, n_pulses=60)
    tx, antenna = pointing.stripmap(made, np.arctan2(4, 3), side="left"), Antenna.gaussian(width=(0.02, 0.2))
    options = {"antenna": antenna, "tolerance": 1e-2, "shadows": False, "range_window": (-700, 1200), "device": device}
    some, every = (sarcl.echo(scene, NARROW, tx, skip=skip, **options) for skip in (True, False))
    left_out = some.report.contributions_skipped["out of beam"]
    total = left_out + some.report.contributions_done + sum(
        n for why, n in some.report.contributions_skipped.items() if why not in ("out of beam", "shadowed")
    )  # fmt: skip
    assert left_out > 0.4 * total and every.report.contributions_skipped["out of beam"] == 0
    assert np.linalg.norm(some.samples - every.samples) <= 1e-4 * np.linalg.norm(every.samples)


@pytest.mark.costly
def test_a_bright_plate_in_a_side_lobe_is_kept(device):
    """A mirror far outside the beam is brighter than all that is in it: none of its facets may be skipped."""
    tx = track(aim=(0, 0, 0))
    middle = tx.positions[len(tx) // 2] - (0, 1500, 0)
    u = middle / np.linalg.norm(middle)
    across, up = np.array([1.0, 0, 0]), np.cross([1.0, 0, 0], u)
    corners = [(0, 1500, 0) + 4 * (a * across - b * up) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    plate = sarcl.Scene.facets(np.array([[corners[0], corners[2], corners[1]], [corners[0], corners[3], corners[2]]]))
    if ((np.cross(corners[2] - corners[0], corners[1] - corners[0])) @ u) < 0:
        plate = sarcl.Scene.facets(plate.triangles[:, ::-1])
    antenna = Antenna.gaussian(width=0.15)
    both = points(20, 100.0) + plate
    raw = sarcl.echo(both, NARROW, tx, antenna=antenna, tolerance=1e-2, shadows=False, device=device)
    assert error(both, raw, antenna, None, tx) <= raw.report.predicted_error <= 1e-2


def test_reports_and_units():
    raw = sarcl.echo(points(), NARROW, track(), antenna=ANTENNAS["pair"], radar=Radar(power=1.0))
    assert raw.report.plan["antennas"] == "gaussian and aperture"
    assert raw.report.plan["units"] == "sqrt(W)"
    assert raw.report.plan["beam's peak over the echoes' mean, dB"] >= 0
    assert "out of beam" not in sarcl.echo(points(), NARROW, track()).report.contributions_skipped


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"antenna": 3}, "antenna"),
        ({"antenna": (ANTENNAS["gaussian"],)}, "1 entries"),
        ({"radar": 1e3}, "radar"),
        ({"antenna": Antenna.gaussian(width=0.05, two_way=True), "receiver": track()}, "two-way"),
    ],
)
def test_bad_antennas_are_named(options, words):
    with pytest.raises((ValueError, TypeError), match=words):
        sarcl.echo(points(), NARROW, track(), **options)


def test_an_antenna_that_nothing_aims():
    bare = sarcl.Trajectory(track().times, track().positions)
    with pytest.raises(ValueError, match="no attitude"):
        sarcl.echo(points(), NARROW, bare, antenna=ANTENNAS["gaussian"])
    assert sarcl.echo(points(), NARROW, bare, antenna=Antenna.isotropic()).samples.any()


def test_a_scene_out_of_the_beam_is_said():
    away = track(aim=(0, -8000, 3000.0))
    for antenna in (Antenna.rectangular(size=1.0), TABLE):
        for scene in (points(), facets()):
            with pytest.raises(ValueError, match="wholly out of the beam"):
                sarcl.echo(scene, NARROW, away, antenna=antenna, shadows=False)
    with pytest.raises(ValueError, match=r"wholly out of the beam|dB below the beam's peak"):
        sarcl.echo(points(), NARROW, away, antenna=Antenna.gaussian(width=0.1))


def test_to_aim_is_a_remedy_only_where_it_meets_the_tolerance():
    antenna, point = Antenna.gaussian(width=0.1), sarcl.Scene.points([(0.0, 0.0, 0.0)])

    def refusal(tolerance, aim):
        with pytest.raises(sarcl.ToleranceUnreachable, match="gains are in float32") as refused:
            sarcl.echo(point, NARROW, track(aim=aim), antenna=antenna, tolerance=tolerance)
        return refused.value

    aimed, beside = (0.0, 0.0, 0.0), (500.0, 0.0, 0.0)  # m; 0.1 rad from the point
    least = refusal(1e-7, aimed)
    assert "beam's peak" not in str(least) and least.remedy == f"pass tolerance={least.best:.1e} or larger"
    assert refusal(1.2 * least.best, beside).remedy == "aim at the scene"
    worse = refusal(0.5 * least.best, beside)
    assert "dB below the beam's peak" in str(worse) and "aim" not in worse.remedy


def test_an_antenna_on_a_scatterer():
    scene = points() + sarcl.Scene.points(track().positions[3:4])
    with pytest.raises(ValueError, match="stands on a scatterer"):
        sarcl.echo(scene, NARROW, track(), radar=Radar(power=1.0), range_window=(-6000, 6000))

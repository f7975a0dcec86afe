"""echo(edges=True): amplitudes, shadows on edges, tolerance, edges that are left out, bad input."""

import numpy as np
import pytest
from helpers.cases import quick_of

import sarcl
from sarcl import Material, Scene, Trajectory, Waveform, shapes
from sarcl.reference.edges import border_echo, edge_echo
from sarcl.scene.facing_borders import facing_borders
from sarcl.scene.wedges import wedges

CHIRP = Waveform.chirp(center=9.6e9, bandwidth=300e6, duration=1e-6)
NEAR = {"reference": (0, 0, 0), "range_window": (-3, 3), "polarization": ("HH", "HV", "VV"), "check": False}
ACROSS = (-3.0, 0.04), True  # a range window that ends on edges, m, seen by two antennas


def around(distance, n=4, incidence=0.9, azimuth=0.4, arc=0.02):
    turn = azimuth + np.linspace(-arc / 2, arc / 2, n)
    look = np.stack(
        [np.sin(incidence) * np.cos(turn), np.sin(incidence) * np.sin(turn), np.full(n, np.cos(incidence))], axis=1
    )
    return Trajectory(np.arange(n) / 100, distance * look)


def edges_alone(scene, track, *, tolerance=1e-3, **options):
    """Samples of the edges, complex128 (n_pulses, 3, n), by difference; the report with them.

    Edges have a fifth of the tolerance, facets the rest of the sum of squares: the same facets are added in both calls.
    """
    options = {**NEAR, **options}
    both = sarcl.echo(scene, CHIRP, track, edges=True, tolerance=tolerance, **options)
    without = sarcl.echo(scene, CHIRP, track, tolerance=tolerance * np.sqrt(1 - 0.2**2), **options)
    shape = len(track.positions), 3, both.n_samples
    return (both.samples.astype(complex) - without.samples).reshape(shape), both


def summed(scene, raw, track, receiver=None, seen=None, per_wave=20, **window):
    """The reference: elements of a 20th of a wavelength, or as many as asked for; and the norm of the edges at random
    phases."""
    edges = wedges(scene.triangles, scene.two_sided, 0.35)
    parts = [
        (edge_echo, ends, frame)
        for ends, *frame in zip(edges.ends, edges.inward, edges.normal, edges.number, strict=True)
    ]
    parts += [(border_echo, *pair) for pair in facing_borders(scene.triangles, edges)]
    frequencies = raw.frequency[0] + raw.frequency_step[0] * np.arange(raw.n_samples)
    out, power = np.zeros((len(track.positions), 3, raw.n_samples), complex), 0.0
    rx = track.positions if receiver is None else receiver.positions
    for p, (to, back) in enumerate(zip(track.positions, rx, strict=True)):
        reference = (np.linalg.norm(to) + np.linalg.norm(back)) / 2
        for echo, ends, frame in parts:
            options = {"seen": seen, "per_wavelength": per_wave if echo is edge_echo else min(per_wave, 100), **window}
            one = echo(ends, tuple(frame), frequencies, (to, back), reference, **options)
            one = one.transpose(1, 2, 0)[[0, 0, 1], [0, 1, 1]]
            out[p], power = out[p] + one, power + (np.abs(one) ** 2).sum()
    return out, np.sqrt(power)


SCENES = {
    "plate": shapes.plate((0.9, 0.5)),
    "box": shapes.box((0.6, 0.4, 0.3), rotation=(0.2, 0.5, -0.4)),
    "wedge": shapes.plate((0.8, 0.8)) + shapes.plate((0.8, 0.8), rotation=(1.0, 0, 0), position=(0, 0.62, 0.34)),
}


def close(got, wanted, norm, tolerance, raw):
    """Whether edges are those wanted, within their share of a tolerance and float32 of all samples."""
    return np.linalg.norm(got - wanted) < 0.2 * tolerance * norm + 3e-7 * np.linalg.norm(raw.samples)


@pytest.mark.parametrize(("distance", "tolerance"), [(12.0, 1e-1), (12.0, 1e-3), (2e5, 1e-3)])
@pytest.mark.parametrize("name", quick_of(["box"], SCENES))
def test_edges_are_sums_over_their_elements_within_their_share_of_the_tolerance(name, distance, tolerance):
    scene, track = SCENES[name], around(distance, n=2)
    got, raw = edges_alone(scene, track, tolerance=tolerance, shadows=False)
    wanted, norm = summed(scene, raw, track)
    assert close(got, wanted, max(norm, np.linalg.norm(wanted)), tolerance, raw)
    assert np.linalg.norm(wanted) > 1e-3 * np.linalg.norm(raw.samples)
    assert raw.report.predicted_error <= tolerance


@pytest.mark.parametrize("seed", quick_of(range(4), range(10)))
def test_random_faces_within_the_tolerance(seed):
    """A prism whose walls lean, or its sheet, one antenna or two, near or far."""
    random = np.random.default_rng(seed)
    angle = np.sort(np.linspace(0, 2 * np.pi, 5)[:-1] + random.uniform(-0.4, 0.4, 4))
    ring = 0.4 * np.stack([1.3 * np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    top = ring * random.uniform(0.8, 1.2) + [0, 0, 0.3]
    faces = [[*ring[::-1]], [*top]] + [[ring[i - 1], ring[i], top[i], top[i - 1]] for i in range(4)]
    faces = faces[1:2] if seed % 3 == 0 else faces
    triangles = np.array([[face[0], face[i], face[i + 1]] for face in faces for i in (1, 2)])
    scene = Scene.facets(triangles, two_sided=len(faces) == 1)
    tolerance, distance = (1e-1, 1e-2, 1e-3)[seed % 3], 1e5 if seed % 4 == 1 else random.uniform(10, 60)
    track = around(distance, n=1, incidence=random.uniform(0.3, 1.4), azimuth=random.uniform(0, 6))
    receiver = around(0.8 * distance, n=1, incidence=0.7, azimuth=random.uniform(0, 6)) if seed % 2 else None
    got, raw = edges_alone(scene, track, receiver=receiver, tolerance=tolerance, shadows=False)
    wanted, norm = summed(scene, raw, track, receiver)
    assert close(got, wanted, norm, tolerance, raw)


def test_a_wall_on_a_face_stands_in_the_way_of_waves_along_it():
    """An absorber 2 cm high between the longer borders of a strip, over two thirds of their length, shades neither."""
    plate, track = shapes.plate((1.5, 0.2)), around(2e5, n=1, incidence=0.8, azimuth=np.pi / 2)
    low, high = [[-0.5, 0, 0], [0.5, 0, 0]], [[0.5, 0, 0.02], [-0.5, 0, 0.02]]
    wall = Scene.facets(np.array([[*low, high[0]], [low[0], *high]]), reflectivity=0.0)
    options = {"skip": {"range window", "facing away"}}
    (full, raw), (less, _) = (edges_alone(scene, track, **options) for scene in (plate, plate + wall))
    pairs = list(facing_borders(plate.triangles, wedges(plate.triangles, plate.two_sided, 0.35)))
    ends, frame = next(pair for pair in pairs if pair[1][2][2] > 0 and np.ptp(pair[0][0, :, 0]) > 1)
    frequencies, place = raw.frequency[0] + raw.frequency_step[0] * np.arange(raw.n_samples), track.positions[0]
    hidden = np.clip(ends, [-0.5, -1, 0], [0.5, 1, 0])
    lost = border_echo(hidden, frame, frequencies, (place, place), np.linalg.norm(place))
    assert np.linalg.norm(full[0] - less[0] - lost.transpose(1, 2, 0)[[0, 0, 1], [0, 1, 1]]) < 0.05 * np.linalg.norm(
        lost
    )
    assert np.abs(lost).max() > 0.05


def test_two_antennas():
    scene, track = SCENES["box"], around(30.0, n=2)
    receiver = around(40.0, n=2, incidence=0.5, azimuth=1.0)
    got, raw = edges_alone(scene, track, receiver=receiver, tolerance=1e-3, shadows=False)
    wanted, norm = summed(scene, raw, track, receiver)
    assert close(got, wanted, norm, 1e-3, raw)


@pytest.mark.parametrize("low", [None, 0.55])
def test_shadows_end_where_they_fall_on_an_edge(low):
    """A roof 1 m above a plate hides a part of its border, which follows from straight lines; the receiver too."""
    plate, roof = shapes.plate((2.0, 1.2)), shapes.plate((0.83, 3.1), position=(0.7, 0.2, 1.0))
    absorber = Scene.facets(roof.triangles, reflectivity=0.0)
    track = around(2e5, n=2)
    receiver = None if low is None else around(2e5, n=2, incidence=low, azimuth=0.9)
    skips = {"range window", "facing away"}
    got, raw = edges_alone(plate + absorber, track, receiver=receiver, tolerance=1e-3, skip=skips)

    def seen(places, antenna):
        ahead = antenna - places
        at = (places + ahead / ahead[:, 2:])[:, :2] - [0.7, 0.2]
        return (np.abs(at) > [0.83 / 2, 3.1 / 2]).any(axis=1)

    wanted, norm = summed(plate, raw, track, receiver, seen, per_wave=400)
    whole, _ = summed(plate, raw, track, receiver)
    assert close(got, wanted, norm, 3e-2, raw)  # elements of the sum are seen whole or not at all: 1.5 mm
    assert np.linalg.norm(whole - wanted) > 0.1 * norm


@pytest.mark.parametrize(("window", "bistatic"), quick_of([ACROSS], [ACROSS, ((-0.05, 0.06), False)]))
@pytest.mark.parametrize("name", quick_of(["plate"], SCENES))
def test_edges_count_by_their_part_inside_the_range_window(name, window, bistatic):
    scene, track = SCENES[name], around(30.0, n=1)
    receiver = around(40.0, n=1, incidence=0.5, azimuth=1.0) if bistatic else None
    got, raw = edges_alone(scene, track, receiver=receiver, tolerance=1e-3, range_window=window, shadows=False)
    wanted, norm = summed(scene, raw, track, receiver, per_wave=2000, window=window)
    whole, _ = summed(scene, raw, track, receiver)
    assert close(got, wanted, norm, 3e-2, raw)  # elements of the sum are inside or outside as a whole
    assert np.linalg.norm(whole - wanted) > 0.05 * norm


def test_edges_behind_their_own_body_are_dark():
    """Three of the twelve edges of a box, at which the wave would come from within: so without rays too."""
    box, track = shapes.box((0.6, 0.4, 0.3)), around(1e4, n=2)
    raw, whole = (sarcl.echo(box, CHIRP, track, edges=True, shadows=shadows, **NEAR) for shadows in (True, False))
    assert raw.report.plan["edges"] == 12
    hidden = 2 * raw.report.plan["pieces of edges"] * (0.6 + 0.4 + 0.3) / (4 * (0.6 + 0.4 + 0.3))
    assert raw.report.contributions_skipped["facing away"] > 0.9 * hidden
    assert np.linalg.norm(raw.samples - whole.samples) < 1e-3 * np.linalg.norm(raw.samples)


def test_edges_of_dielectrics_rough_and_creased_surfaces_are_left_out():
    scene = shapes.box((0.6, 0.4, 0.3))
    concrete = shapes.box((0.6, 0.4, 0.3), material="concrete")
    rough = shapes.box((0.6, 0.4, 0.3), material=Material(height=2e-3))
    track = around(1e4, n=2)
    for other in (concrete, rough):  # of which one has no coherent part in HV: the same facets
        got, raw = edges_alone(other, track)
        assert raw.report.plan["edges"] == 0
        assert not got.any()
    material = ["metal"] * 10 + ["concrete"] * 2
    mixed = Scene.facets(scene.triangles, material=material, two_sided=False)
    plan = sarcl.echo(mixed, CHIRP, track, edges=True, **NEAR).report.plan
    assert plan["edges"] + plan["edges left out"] == 12
    assert plan["edges left out"] in (3, 4, 5)
    cylinder = shapes.cylinder(0.3, 0.5)
    assert sarcl.echo(cylinder, CHIRP, track, edges=True, crease=1.6, **NEAR).report.plan["edges"] == 0


def test_reflectivity_weighs_edges():
    track, options = around(1e4, n=2), {"shadows": False}
    full, _ = edges_alone(shapes.plate((0.9, 0.5)), track, **options)
    half, _ = edges_alone(Scene.facets(shapes.plate((0.9, 0.5)).triangles, reflectivity=0.5), track, **options)
    assert np.linalg.norm(half - full / 2) < 1e-3 * np.linalg.norm(full)


def test_the_check_includes_edges():
    raw = sarcl.echo(SCENES["box"], CHIRP, around(50.0), edges=True, **{**NEAR, "check": True}, tolerance=1e-2)
    assert 0 < raw.report.measured_error < 1e-2
    edges = next(term for term in raw.report.error_terms if term.name == "edges")
    assert edges.value <= 0.2e-2


def test_channels_of_an_array_have_their_edges():
    array = sarcl.AntennaArray.linear(3, spacing=0.5, frequency_step=0.0, axis=(0, 1, 0))
    scene, track, tolerance = SCENES["box"], around(50.0, n=2), 1e-3
    options = {**NEAR, "polarization": "HH", "channels": "separated", "shadows": False, "array": array}
    raw = sarcl.echo(scene, CHIRP, track, edges=True, tolerance=tolerance, **options)
    facets = sarcl.echo(scene, CHIRP, track, tolerance=tolerance * np.sqrt(1 - 0.2**2), skip=False, **options)
    for channel in range(3):
        rows = np.flatnonzero(raw.tx_channel == channel)
        got = raw.samples[rows].astype(complex) - facets.samples[rows]
        ends = [Trajectory(track.times, place[rows]) for place in (raw.tx, raw.rx)]
        wanted, norm = summed(scene, raw, ends[0], ends[1])
        assert np.linalg.norm(np.abs(got) - np.abs(wanted[:, 0])) < 2e-3 * norm


def test_a_forecast_has_the_term_of_edges():
    forecast = sarcl.plan(sarcl.echo, SCENES["box"], CHIRP, around(1e4), edges=True, tolerance=1e-2)
    assert "edges" in [term.name for term in forecast.error_terms]
    assert forecast.predicted_error <= 1e-2
    raw = sarcl.echo(SCENES["box"], CHIRP, around(1e4), edges=True, tolerance=1e-2)
    assert np.array_equal(forecast.run().samples, raw.samples)


@pytest.mark.parametrize(
    ("options", "kind", "words"),
    [
        ({"edges": "yes"}, TypeError, "edges"),
        ({"edges": True, "crease": 0.0}, ValueError, "crease"),
        ({"edges": True, "crease": -1.0}, ValueError, "crease"),
        ({"edges": True, "crease": np.nan}, ValueError, "crease"),
        ({"edges": True, "crease": 4.0}, ValueError, "crease"),
    ],
)
def test_bad_input(options, kind, words):
    with pytest.raises(kind, match=words):
        sarcl.echo(SCENES["box"], CHIRP, around(1e4), **options)


def test_other_verbs_refuse_edges_by_name():
    for verb in (sarcl.spectral_echo, sarcl.fullwave_echo):
        with pytest.raises(TypeError, match="edges"):
            verb(SCENES["box"], CHIRP, around(1e4), edges=True)

"""rcs(edges=True) of one body described in other ways: turned, mirrored, cut, with faults of meshes; limits."""

import numpy as np
import pytest

import sarcl
from sarcl import Scene, shapes
from sarcl.reference.edges import border_echo, edge_echo
from sarcl.scene.facing_borders import facing_borders
from sarcl.scene.wedges import wedges

F = 3e9
POLARIZATIONS = ("HH", "HV", "VH", "VV")
AZIMUTH, ELEVATION = np.linspace(0.05, 6, 7), 0.4
BOX = Scene.facets(shapes.box((0.5, 0.4, 0.3), rotation=(0.2, 0.5, -0.4)).triangles, two_sided=False)
ABOVE_PLATE = BOX + Scene.facets(shapes.plate((0.7, 0.6), position=(0, 0, -0.6)).triangles)
RECEIVERS = {"one antenna": None, "two antennas": (AZIMUTH + 0.7, 0.2)}


def section(scene, azimuth=AZIMUTH, elevation=ELEVATION, receiver=None, **options):
    options = {"edges": True, "polarization": POLARIZATIONS, "tolerance": 1e-3, **options}
    return sarcl.rcs(scene, azimuth, elevation, F, receiver=receiver, **options)


def with_facets(scene, triangles):
    return Scene.facets(triangles, two_sided=scene.two_sided)


def difference(a, b):
    return np.abs(a - b).max() / np.abs(a).max()


@pytest.mark.parametrize("receiver", RECEIVERS)
@pytest.mark.parametrize("scene", [BOX, ABOVE_PLATE], ids=["box", "box above a plate"])
def test_bodies_turned_mirrored_or_cut_are_the_same(scene, receiver):
    pair = RECEIVERS[receiver]
    wanted = section(scene, receiver=pair)
    c, s = np.cos(1.234), np.sin(1.234)
    rotated = with_facets(scene, scene.triangles @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]))
    turned = None if pair is None else (pair[0] + 1.234, pair[1])
    assert difference(wanted, section(rotated, AZIMUTH + 1.234, receiver=turned)) < 3e-6
    mirrored = with_facets(scene, scene.triangles[:, ::-1] * [1, -1, 1])
    across = None if pair is None else (-pair[0], pair[1])
    assert difference(wanted, section(mirrored, -AZIMUTH, receiver=across) * [1, -1, -1, 1]) < 3e-6
    assert difference(wanted, section(scene.split(0.12), receiver=pair)) < 3e-6  # each edge in about five parts
    if pair is None:
        assert difference(wanted[:, 1], wanted[:, 2]) < 1e-12


def test_a_half_hidden_edge_is_the_edge_cut_at_the_end_of_its_shadow():
    """An absorber above half a plate hides the border behind x = -shift, seen from azimuth 0."""
    elevation, polarization = 1.2, ("HH", "VV")
    look, shift = np.array([np.cos(elevation), 0, np.sin(elevation)]), 0.5 / np.tan(elevation)
    plate = shapes.plate((0.8, 0.4))
    roof = Scene.facets(shapes.plate((0.8, 3.0), position=(0.4, 0, 0.5)).triangles, reflectivity=0.0)
    both, alone = (section(plate + roof, 0.0, elevation, edges=e, polarization=polarization) for e in (True, False))
    border, wanted = wedges(plate.triangles, plate.two_sided, 0.35), np.zeros(2, complex)
    for ends, *frame in zip(border.ends, border.inward, border.normal, border.number, strict=True):
        low, high = np.sort(ends[:, 0])
        if low < -shift:
            share = min((-shift - low) / max(high - low, 1e-9), 1.0)
            start, stop = ends[np.argsort(ends[:, 0], kind="stable")]
            seen = np.array([start, start + share * (stop - start)])
            one = edge_echo(seen, tuple(frame), np.array([F]), (1e8 * look, 1e8 * look), 1e8, per_wavelength=200)[0]
            wanted += one[[0, 1], [0, 1]]
    for borders, frame in facing_borders(plate.triangles, border):
        if np.ptp(borders[0, :, 0]) > 0.1:  # of the others, the one at x > 0 is dark
            seen = np.minimum(borders, [-shift, 1, 1])
            wanted += border_echo(seen, frame, np.array([F]), (1e8 * look, 1e8 * look), 1e8)[0][[0, 1], [0, 1]]
    assert difference(wanted, both - alone) < 2e-3  # the end of the shadow is found to 1/4096 of a piece


@pytest.mark.filterwarnings("ignore:1 facet lies on another")
def test_faults_of_meshes():
    wanted, triangles = section(BOX), BOX.triangles
    jitter = np.random.default_rng(0).uniform(-1e-8, 1e-8, triangles.shape)  # m: corners that do not coincide
    assert difference(wanted, section(with_facets(BOX, triangles + jitter))) < 1e-4
    sliver = [triangles[0, 0], triangles[0, 1], (triangles[0, 0] + triangles[0, 1]) / 2]
    with_sliver = Scene.facets(np.concatenate([triangles, [sliver]]), two_sided=False)
    assert difference(wanted, section(with_sliver)) < 1e-9
    inside_out = section(with_facets(BOX, triangles[:, ::-1]))  # reflects inwards alone
    assert not inside_out.any()
    fin = [triangles[0, 0], triangles[0, 1], triangles[0, 0] + [0, 0, 0.5]]  # the third facet at an edge
    assert np.isfinite(section(Scene.facets(np.concatenate([triangles, [fin]])))).all()
    twice = Scene.facets(np.concatenate([triangles, triangles[:1]]), two_sided=False)
    assert np.isfinite(section(twice)).all()


@pytest.mark.parametrize("seed", range(4))
def test_bodies_seen_from_anywhere_send_back_something_finite(seed):
    random = np.random.default_rng(seed)
    body = shapes.cylinder(0.2, 0.4, sections=8, rotation=tuple(random.uniform(-2, 2, 3)))
    azimuth, elevation = np.append(random.uniform(0, 6, 20), [0, np.pi / 2, 0]), random.uniform(-1.5, 1.5, 23)
    elevation[-3:] = 0, np.pi / 2, -np.pi / 2  # also along axes
    receiver = (azimuth + 0.9, elevation) if seed % 2 else None
    got = section(body, azimuth, elevation, receiver=receiver)
    assert np.isfinite(got).all()
    assert np.abs(got).max() < 30


@pytest.mark.parametrize("receiver", [(0.9, 0.6), (1.4, 1.1)])
def test_the_field_is_continuous_where_facets_turn_into_the_light(receiver):
    """Physical optics jumps where the transmitter passes a face's plane, the currents of its edges jump back."""
    box = Scene.facets(shapes.box((0.5, 0.4, 0.3)).triangles, two_sided=False)
    elevation = np.array([-1e-3, -2e-4, 2e-4, 1e-3])
    got = section(box, 0.3, elevation, receiver=receiver)
    steps = np.abs(np.diff(got, axis=0)).max(axis=1)
    assert steps[1] < 0.02 * np.abs(section(box)).max()

"""Lit parts of facets: shares and phase integrals against polygons clipped another way, and degenerate polygons."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.cases import quick_of
from helpers.lit_cases import lit_polygon

import sarcl
from sarcl.base.vectors import unit
from sarcl.reference.lit_part import lit_part
from sarcl.scene.terrain import stand_above
from sarcl.scene.triangles import normals
from sarcl.visibility import _shadow_pairs
from sarcl.visibility._shadow_pairs import candidate_pairs
from sarcl.visibility.lit_parts import FacetPieces, LitParts

WAVES = np.array([1.0, 30.0, 200.0, 400.0])  # rad/m
TOLERANCE = 2e-7  # float64, stored in float32; also of devices that leave float64 to another one
FACET = np.array([[[0, 0, 0], [1, 0, 0], [0, 1, 0]]], float)


def lit_parts(device, triangles, occluders, ends, *, two_sided=True, **options):
    pieces = FacetPieces.uncut(triangles, np.full(len(triangles), two_sided))
    return LitParts(device, pieces, occluders, ends, max_bytes=1e8, **options)


def shares(device, triangles, occluders, ends, **options):
    """Shares of all facets at each pulse (n, k)."""
    parts = lit_parts(device, triangles, occluders, ends, **options)
    out = np.ones((len(ends[0]), len(triangles)))
    out[:, parts.partly] = parts.at(0, ends, np.zeros(0))[0]
    out[:, parts.dark] = 0
    return out


def soup(seed):
    """A facet, up to 11 occluders above, below and through it, and one antenna or two from near to far, 3 pulses."""
    random = np.random.default_rng(seed)
    facet = random.uniform(-1, 1, (1, 3, 3)) * [1, 1, 0.05]
    occluders = random.uniform(-0.7, 0.7, (random.integers(1, 12), 3, 3)) * [1, 1, 0.5] + [0, 0, 0.3]
    antenna = random.uniform(-3, 3, 3) * [1, 1, 0] + [0, 0, random.choice([1.5, 10, 1e4])]
    ends = [antenna + random.normal(0, 0.02, (3, 3))]
    if seed % 2:
        ends.append(ends[0] + random.normal(0, 0.5, 3) * [1, 1, 0.1])
    return facet, occluders, ends


@pytest.mark.parametrize("seed", range(24))
def test_share_and_phase_integral_are_those_of_the_facet_less_every_shadow(device, seed):
    facet, occluders, ends = soup(seed)
    parts = lit_parts(device, facet, occluders, ends)
    limit = TOLERANCE
    share, mean = parts.at(0, ends, WAVES)
    for pulse in range(3):
        wanted, integral = lit_part(facet[0], occluders, [end[pulse] for end in ends], WAVES, parts.on_plane)
        if parts.partly[0]:
            assert share[pulse, 0] == pytest.approx(wanted, abs=limit)
            np.testing.assert_allclose(mean[pulse, 0], integral, atol=limit)
        else:
            assert wanted == pytest.approx(0 if parts.dark[0] else 1, abs=limit)


@pytest.mark.parametrize("seed", range(24, 36))
def test_the_reference_has_the_areas_of_another_librarys_polygons(seed):
    facet, occluders, ends = soup(seed)
    antennas = [end[0] for end in ends]
    polygon = lit_polygon(facet[0], occluders, antennas)
    area = np.linalg.norm(np.cross(facet[0, 1] - facet[0, 0], facet[0, 2] - facet[0, 0])) / 2
    assert lit_part(facet[0], occluders, antennas, WAVES)[0] == pytest.approx(polygon.area / area, abs=1e-9)


@pytest.mark.parametrize("seed", [377, 1258, 2965, 3910, 4643])
def test_the_reference_leaves_no_negative_share_of_a_facet_that_is_dark(seed):
    """Under three occluders whose shadows together are the facet: what is left are slivers of rounding."""
    random = np.random.default_rng(seed)
    antenna = random.uniform([-3, -3, 2], [3, 3, 20])
    top = antenna + (FACET[0] - antenna) * random.uniform(0.1, 0.9)
    fan = np.array([[top[i - 1], top[i], top.mean(axis=0)] for i in range(3)])
    assert 0 <= lit_part(FACET[0], fan, [antenna], np.zeros(0))[0] < 1e-9


ABOVE = [np.array([[0.1, 0.2, 1e4]])]


def shifted(x, y, z, size=0.2):
    return np.array([[[x, y, z], [x + size, y, z], [x, y + size, z]]])


@pytest.mark.parametrize(
    "occluders, share",
    [
        (shifted(0.1, 0.1, 0.3), 0.96),
        (np.concatenate([shifted(0.1, 0.1, 0.3)] * 3), 0.96),  # the same sheet three times
        (np.concatenate([shifted(0.1, 0.1, 0.3), shifted(0.1, 0.1, 0.3)[:, ::-1]]), 0.96),  # wound both ways
        (np.concatenate([shifted(0.1, 0.1, 0.2), shifted(0.3, 0.1, 0.2)[:, [1, 2, 0]]]), 0.92),  # touch in a corner
        (sarcl.shapes.plate((0.2, 0.2)).moved((0.2, 0.2, 0.2)).triangles, 0.92),  # a square of two triangles
        (FACET, 1.0),  # the facet itself
        (np.add(FACET, [0, 0, 1e-9]), 1.0),  # a sheet that coincides
        (FACET - [0, 0, 0.1], 1.0),  # below
        (np.add(FACET, [0, 0, 2e4]), 1.0),  # beyond the antenna
        (np.array([[[0, 0, 0], [1, 0, 0], [0, 0, 1]]], float), 1.0),  # a wall on the facet's edge, seen edge-on
        (np.array([[[-5, -5, 1], [5, -5, 1], [0, 5, 1]]], float), 0.0),  # over all of it
        (np.array([[[0.1, 0.1, 0.1], [0.1, 0.1, 0.1], [0.3, 0.1, 0.1]]]), 1.0),  # without area
    ],
)  # fmt: skip
def test_shares_where_polygons_degenerate(every_device, occluders, share):
    far = [np.array([[0.3, 0.3, 1e8]])]  # shadows are as large as what casts them
    if np.abs(occluders).max() > 1e3:
        far = ABOVE
    found = shares(every_device, FACET, occluders, far)
    assert found[0, 0] == pytest.approx(share, abs=1e-7)


@pytest.mark.parametrize("azimuth", [0.0, 0.3, np.pi / 4, 2.0])
def test_a_closed_box_on_a_plate_hides_what_is_under_it_and_its_shadow(every_device, azimuth):
    """Faces touch at edges, stand on the plate, and are seen along their planes: every border counts once."""
    plate = sarcl.shapes.plate((8.0, 8.0)).triangles
    box = sarcl.shapes.box((1.0, 1.0, 1.0)).triangles
    u = np.array([np.sin(0.7) * np.cos(azimuth), np.sin(0.7) * np.sin(azimuth), np.cos(0.7)])
    scene = np.concatenate([plate, box])
    found = shares(every_device, plate, scene, [2e6 * u[None]])
    shift = np.abs(u[:2] / u[2])
    hull = 1 + shift[0] * 1 + shift[1] * 1  # area of a unit square swept along the shift
    area = np.linalg.norm(np.cross(plate[:, 1] - plate[:, 0], plate[:, 2] - plate[:, 0]), axis=1) / 2
    assert (area * (1 - found[0])).sum() == pytest.approx(hull, abs=2e-5)


def test_faces_of_a_convex_body_do_not_shadow_one_another(every_device):
    sphere = sarcl.shapes.sphere(1.0, edge=0.4).triangles
    found = shares(every_device, sphere, sphere, [np.array([[30.0, 20.0, 40.0]])], two_sided=False)
    assert (found == 1).all()


def test_a_pole_that_passes_between_two_pulses_is_found_at_the_pulse_that_it_hides(every_device):
    """0.01 m wide and seen by one pulse of 200 on a facet of 0.1 m: no sampling of pulses decides."""
    pole = np.array([[[1.995, -3, 0.5], [2.005, -3, 0.5], [2.0, 3, 0.5]]])
    small = 0.1 * FACET - [0.05, 0.05, 0]
    along = np.linspace(0, 40, 200)
    track = np.stack([along, np.zeros(200), np.full(200, 5.0)], axis=1)
    found = shares(every_device, small, pole, [track])[:, 0]
    for pulse in np.flatnonzero(found < 1):
        assert abs(track[pulse, 0] / 10 - 2.0) < 0.2
    wanted = [lit_part(small[0], pole, [place], WAVES)[0] for place in track]
    np.testing.assert_allclose(found, wanted, atol=TOLERANCE)
    assert found.min() < 0.95 and (found < 1).sum() < 10


@pytest.mark.parametrize("seed", range(6))
def test_candidate_pairs_leave_out_no_pair_that_meets_from_any_pulse(seed):
    random = np.random.default_rng(seed)
    receivers = random.uniform(-5, 5, (16, 1, 3)) + random.standard_normal((16, 3, 3)) * random.choice([0.05, 0.5])
    occluders = random.uniform(-5, 5, (16, 1, 3)) + random.standard_normal((16, 3, 3)) * random.choice([0.05, 2.0])
    middle = random.standard_normal(3)
    middle *= random.choice([2.0, 20.0, 500.0]) / np.linalg.norm(middle)
    turn = 0.02
    away = max(np.linalg.norm(middle) - 12, 0)
    reach = turn * away / 2
    others = middle + random.uniform(-1, 1, (5, 3)) * reach / np.sqrt(3)
    found = {
        tuple(pair)
        for pair in candidate_pairs(receivers, occluders, middle, turn, reach, lambda p: np.ones(len(p), bool))
    }
    for antenna in others:
        for i, facet in enumerate(receivers):
            for j, occluder in enumerate(occluders):
                if (i, j) not in found:
                    assert lit_part(facet, occluder[None], [antenna], WAVES[:1])[0] == pytest.approx(1, abs=1e-9)


@pytest.mark.parametrize("reach", [0.0, 0.5])
@pytest.mark.parametrize("seed", range(3))
def test_candidate_pairs_hold_all_that_antennas_among_the_facets_see_behind_one_another(seed, reach):
    """Lines of sight from 20 antennas, within `reach` of one, to the middles of facets all around."""
    random = np.random.default_rng(seed)
    receivers, occluders = (
        random.uniform(-5, 5, (300, 1, 3)) + random.standard_normal((300, 3, 3)) * size for size in (0.05, 0.3)
    )
    middle = random.uniform(-1, 1, 3)
    pairs = candidate_pairs(receivers, occluders, middle, 2.0, reach, lambda p: np.ones(len(p), bool))
    found = np.zeros((300, 300), bool)
    found[tuple(pairs.T)] = True
    missed = crossings = 0
    for antenna in middle + random.uniform(-1, 1, (20, 3)) * reach / np.sqrt(3):
        ray, at = (antenna - receivers.mean(axis=1))[:, None], receivers.mean(axis=1)[:, None] - occluders[:, 0]
        b, c = occluders[:, 1] - occluders[:, 0], occluders[:, 2] - occluders[:, 0]
        across = np.cross(ray, c)
        det = (across * b).sum(axis=-1)
        u, q = (at * across).sum(axis=-1) / det, np.cross(at, b)
        v, t = (q * ray).sum(axis=-1) / det, (q * c).sum(axis=-1) / det  # Moeller and Trumbore 1997
        crosses = (u > 0) & (v > 0) & (u + v < 1) & (t > 0) & (t < 1)
        crossings, missed = crossings + crosses.sum(), missed + (crosses & ~found).sum()
    assert crossings > 300 and missed == 0 and found.mean() < 0.5


def test_pairs_beyond_the_memory_are_found_anew_with_the_same_bits(every_device):
    facets = np.concatenate([soup(seed)[0] for seed in range(6)])
    _, occluders, ends = soup(0)
    k = len(facets)
    found = []
    for max_bytes in (1e8, 1.0):
        pieces = FacetPieces.uncut(facets, np.ones(k, bool))
        parts = LitParts(every_device, pieces, occluders, ends, max_bytes=max_bytes)
        found.append([parts.partly, parts.dark, *parts.at(0, ends, WAVES)])
    assert found[0][0].any()
    for one, other in zip(*found, strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("sine", [-3e-3, -5e-7, 5e-4, 3e-3])
@pytest.mark.parametrize("turn", [0.0, 1e-3])
def test_of_two_antennas_one_that_is_edge_on_or_behind_casts_no_shadow(sine, turn, device):
    """Whatever pulses share a block: the echo fades there, and what is left of it has the shadows of the other one."""
    screens = np.array([[[2, -3, -1], [2, 3, -1], [2, 0, 9]], [[0.2, -2, 0.5], [0.2, 2, 0.5], [-2, 0, 0.5]]], float)
    low, high = np.array([[1e4, 0, 1e4 * sine], [1e4, 1e4 * turn, 1e4 * sine]]), np.array([[0, 0, 1e4], [0, 0, 1e4]])
    found = shares(device, FACET, screens, [low, high])
    for pulse, share in enumerate(found[:, 0]):
        wanted, _ = lit_part(FACET[0], screens, [low[pulse], high[pulse]], WAVES)
        assert share == pytest.approx(wanted, abs=1e-6)
    assert (found == 0).all() if sine > 0 else (0.2 < found).all() and (found < 0.8).all()


def test_walls_that_meet_above_the_antenna_leave_no_gap_between_their_shadows(device):
    """Shadows of what reaches above the antenna are a million times as long as the facet: rounding must part neither
    the edge that both walls share nor lose the distance beside it."""
    random = np.random.default_rng(0)
    floor = np.array([[[4.46, -2.82, 0], [4.46, 2.82, 0], [-4.46, -2.82, 0]]])
    for _ in range(40):
        foot, top, left, right = random.uniform(-2, 2, (4, 3)) * [1, 1, 0] + [
            [0, 0, 0],
            [0, 0, 1.45],
            [0, 0, 0],
            [0, 0, 0],
        ]
        walls = np.array([[foot, left, top], [right, top, foot]])
        low = np.stack([random.uniform(-3, 3, 8), random.uniform(-2, 2.5, 8), random.uniform(0.05, 1.4, 8)], axis=1)
        found = shares(device, floor, walls, [low])[:, 0]
        wanted = [lit_part(floor[0], walls, [antenna], np.zeros(0))[0] for antenna in low]
        np.testing.assert_allclose(found, wanted, atol=TOLERANCE)


@pytest.mark.parametrize("seed", range(6))
def test_nothing_is_seen_from_within_a_closed_body_in_a_room(device, seed):
    random = np.random.default_rng(seed)
    room, size = sarcl.shapes.box(random.uniform(5, 9, 3)), random.uniform(0.3, 1.5, 3)
    body = sarcl.shapes.box(size).moved((0.3, -0.2, 0.1))
    inside = np.array([0.3, -0.2, 0.1 + size[2] / 2]) + 0.45 * random.uniform(-1, 1, 3) * size
    facets = np.concatenate([room.triangles[:, ::-1], body.triangles])
    found = shares(device, facets, facets, [inside[None]], two_sided=False)[0]
    assert (found[((inside - facets[:, 0]) * normals(facets)).sum(axis=1) > 0] == 0).all()


@pytest.mark.parametrize("reach", [0.0, 0.5])
def test_pairs_of_many_facets_are_found_by_a_grid_as_by_all_pairs(reach, monkeypatch):
    random = np.random.default_rng(2)
    receivers, occluders = (
        random.uniform(-5, 5, (90, 1, 3)) + random.standard_normal((90, 3, 3)) * size for size in (0.05, 0.3)
    )
    antenna = np.array([1.0, 0.5, -0.3]) if reach else np.array([200.0, 50.0, 90.0])

    def found():
        return candidate_pairs(receivers, occluders, antenna, 0.02, reach, lambda p: np.ones(len(p), bool))

    of_all = found()
    monkeypatch.setattr(_shadow_pairs, "PAIRS_AT_ONCE", 64)
    assert 50 < len(of_all) < 4000 and np.array_equal(found(), of_all)


def test_an_edge_under_more_shadows_than_are_listed_at_once(device):
    """A comb of 40 strips over a facet; the strips are given in the order of a shuffle, and some overlap."""
    random = np.random.default_rng(4)
    starts = np.linspace(-0.05, 1.0, 40) + random.uniform(0, 0.01, 40)
    strips = [[[x, -1, 0.2], [x + 0.02, -1, 0.2], [x, 3, 0.2]] for x in starts.tolist()]
    occluders = random.permutation(np.array(strips, float))
    ends = [np.array([[0.3, 0.4, 50.0], [0.2, 0.4, 50.0]])]
    parts = lit_parts(device, FACET, occluders, ends)
    share, mean = parts.at(0, ends, WAVES)
    for pulse in range(2):
        wanted, integral = lit_part(FACET[0], occluders, [ends[0][pulse]], WAVES, parts.on_plane)
        assert share[pulse, 0] == pytest.approx(wanted, abs=TOLERANCE)
        np.testing.assert_allclose(mean[pulse, 0], integral, atol=TOLERANCE)


@pytest.mark.parametrize("stands", [False, True])
@pytest.mark.parametrize("bistatic", quick_of([True], [False, True]))
def test_only_slopes_that_face_away_from_an_antenna_shade_a_terrain(device, bistatic, stands):
    """Hills with a house sunk in them, or standing above them, from low antennas: the shadows of every facet, clipped
    one by one."""
    axis = np.linspace(-15.0, 15.0, 6)
    terrain = sarcl.Scene.from_heights(axis, axis, np.random.default_rng(3).normal(0.0, 2.0, (6, 6)))
    hills = terrain.triangles
    place = (12.0, -12.0, terrain.heights[2][:2, 4:].max()) if stands else (1.0, 2.0, -4.0)
    facets = np.concatenate([hills, sarcl.shapes.box((5.0, 5.0 if stands else 7.0, 9.0)).moved(place).triangles])
    on_ground = np.arange(len(facets)) < len(hills)
    is_above = stand_above(terrain.heights, facets)
    assert is_above[~on_ground].all() == stands
    upper = on_ground | (is_above & stands)
    ends = [np.array([[-150.0, y, 40.0] for y in (-9.0, 0.0, 9.0)])]
    if bistatic:
        ends.append(np.array([[-90.0, y, 35.0] for y in (80.0, 82.0, 84.0)]))
    every = np.ones(len(facets), bool)
    pieces = FacetPieces(facets, ~every, every, facets, np.arange(len(facets)), on_ground, upper)
    parts = LitParts(device, pieces, facets, ends, max_bytes=1e8)
    faces = np.all([((end[1] - facets[:, 0]) * normals(facets)).sum(axis=1) > 0 for end in ends], axis=0)
    share = np.where(parts.dark, 0.0, 1.0)
    share[parts.partly] = parts.at(0, ends, np.zeros(0))[0][1]
    antennas = [end[1] for end in ends]
    wanted = [lit_part(facet, facets, antennas, np.zeros(0), parts.on_plane)[0] for facet in facets[faces]]
    np.testing.assert_allclose(share[faces], wanted, atol=1e-6)
    of_ground, of_house = share[faces & on_ground], share[faces & ~on_ground]
    for shares in (of_ground, of_house):
        assert ((shares > 0.01) & (shares < 0.99)).any()
    rows = np.flatnonzero(on_ground[parts.partly])
    occluders = np.concatenate([parts.occluders_at(1, row)[0] for row in rows])
    slopes = occluders[(occluders[:, None] == hills).all(axis=(2, 3)).any(axis=1)]
    cosines = [(unit(end[1] - slopes[:, 0]) * normals(slopes)).sum(axis=1) for end in ends]
    assert len(slopes) > 20 and np.min(cosines, axis=0).max() < 0.1


def test_phase_integrals_of_small_and_of_nearly_equal_phases(device):
    """A shadow far smaller than a wave, and lines along which the phase hardly changes: the series of the kernel."""
    occluder = np.array([[[0.1, 0.2, 0.5], [0.7, 0.2, 0.5], [0.2, 0.9, 0.5]]])
    for antenna in ([0.0, 0.0, 1e6], [1.0, 0.0, 1e6], [3e5, 1.0, 1e6], [1e2, 3e5, 1e6]):
        ends = [np.array([antenna])]
        parts = lit_parts(device, FACET, occluder, ends)
        waves = np.array([1e-6, 1e-3, 0.05, 300.0])
        wanted = lit_part(FACET[0], occluder, [ends[0][0]], waves, parts.on_plane)[1]
        np.testing.assert_allclose(parts.at(0, ends, waves)[1][0, 0], wanted, atol=TOLERANCE)

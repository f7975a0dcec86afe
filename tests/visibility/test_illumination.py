"""Illuminated shares: outlines of shadows on the ground, halves of facets, blocks of pulses, and invariances."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
import trimesh
from helpers.cases import quick_of, thinned
from scipy.spatial import ConvexHull

import sarcl
from sarcl.base.boxes import box
from sarcl.base.vectors import unit
from sarcl.opencl.choose_device import open_device
from sarcl.reference.shadow import hidden
from sarcl.scene.triangles import areas, centroids, normals
from sarcl.visibility import _frame, illumination
from sarcl.visibility._aspect_blocks import projected_width, pulse_blocks, shadow_length
from sarcl.visibility._facet_samples import PER_LINE, sample_points
from sarcl.visibility._illumination_solver import IlluminationSolver, Occlusion
from sarcl.visibility._viewpoints import refine_viewpoints
from sarcl.visibility.illumination import lit

TOLERANCE = {
    "straight edge": 1 / 64 + 0.008,  # half a line of samples, and 1/255 steps of roots with the lift's displacement
    "mean share": 2e-3,  # errors of many facets are as often up as down
}


def eye(azimuth_deg, incidence_deg, distance=10e3):
    a, i = np.deg2rad(azimuth_deg), np.deg2rad(incidence_deg)
    return distance * np.array([np.sin(i) * np.cos(a), np.sin(i) * np.sin(a), np.cos(i)])


def ground(n=40, size=40.0):
    x = np.linspace(-size / 2, size / 2, n + 1)
    return sarcl.Scene.from_heights(x, x, np.zeros((n + 1, n + 1))).triangles


def frustum(base=5.0, top=2.0, height=6.0):
    corners = [[x * s, y * s, z] for s, z in ((base, 0), (top, height)) for x in (-1, 1) for y in (-1, 1)]
    return trimesh.convex.convex_hull(np.array(corners, float))


BODIES = {
    "cuboid": trimesh.creation.box((4.2, 7.7, 5.0)).apply_translation((0.3, 0.1, 2.5)),
    "frustum": frustum(),
    "cylinder": trimesh.creation.cylinder(3.1, 7.0, sections=48).apply_translation((0.2, -0.4, 3.5)),
    "cone": trimesh.creation.cone(4.0, 8.0, sections=48),
}


def shadow_outline(body, viewpoint):
    """Convex outline of a body's shadow on z = 0, counter-clockwise."""
    v = np.asarray(body.vertices)
    fall = v + (v - viewpoint) * (v[:, 2:] / (viewpoint[2] - v[:, 2:]))
    return fall[ConvexHull(fall[:, :2]).vertices, :2]


def area_within(triangle, outline):
    """Area of a flat triangle (3, 2) inside a convex outline (n, 2): Sutherland and Hodgman 1974."""
    polygon = list(triangle)
    for a, b in zip(outline, np.roll(outline, -1, axis=0), strict=True):
        side = [(b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]) for p in polygon]
        kept = []
        for i, p in enumerate(polygon):
            q, s, t = polygon[i - 1], side[i], side[i - 1]
            if s * t < 0:
                kept.append(q + (p - q) * (t / (t - s)))
            if s >= 0:
                kept.append(p)
        polygon = kept
        if not polygon:
            return 0.0
    x, y = np.array(polygon).T
    return abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2


def shares(triangles, viewpoint, device=None, lines=16, **options):
    """Shares, with the error of roots that are rounded to 1/255."""
    solver = IlluminationSolver(open_device(device), triangles, **options)
    solver.take_lines(lines)
    return (solver.look([np.asarray(viewpoint)]).levels / 255) ** 2


@pytest.mark.parametrize("name, azimuth, incidence", thinned(BODIES, [(0, 45), (37, 60), (190, 30)]))
def test_a_body_on_flat_ground_shadows_its_outline_and_nothing_else(device, name, azimuth, incidence):
    viewpoint, floor, body = eye(azimuth, incidence), ground(), BODIES[name]
    share = shares(np.concatenate([floor, body.triangles]), viewpoint, device, two_sided=False)[: len(floor)]
    outline = shadow_outline(body, viewpoint)
    dark = np.array([area_within(t[:, :2], outline) for t in floor]) / areas(floor)
    # the lift moves a shadow's edge by up to 2e-3 facets
    inner, outer = (outline.mean(axis=0) + s * (outline - outline.mean(axis=0)) for s in (0.998, 1.002))
    deep, clear = ([area_within(t[:, :2], line) / areas(t[None])[0] for t in floor] for line in (inner, outer))
    # exactly: no signal at all comes from full shadow
    assert (share[np.array(deep) > 1 - 1e-9] == 0).all() and (share[np.array(clear) == 0] == 1).all()
    assert ((dark > 0) & (dark < 1)).sum() > 15 and (np.array(deep) > 1 - 1e-9).sum() > 50
    # corners of the outline, and edges across which two outlines pass, are no straight edges
    error = np.abs(share - (1 - dark))
    assert np.quantile(error[(dark > 0) & (dark < 1)], 0.9) < TOLERANCE["straight edge"]
    assert np.mean(share) == pytest.approx(1 - dark.mean(), abs=TOLERANCE["mean share"])


@pytest.mark.parametrize("look", [20, 45, 63])
def test_a_cuboids_shadow_on_the_ground_is_height_times_tangent_of_look(look):
    """SARAS Fig 13: h tan(look) in ground range."""
    height, floor = 5.0, ground(160, 40)
    cuboid = trimesh.creation.box((4, 8, height)).triangles + np.array([0, 0, height / 2])
    share = shares(np.concatenate([floor, cuboid]), eye(0, look, 36e6), two_sided=False)[: len(floor)]
    middle = np.abs(centroids(floor)[:, 1]) < 3
    dark = (1 - share[middle]) @ areas(floor[middle]) / 6.0  # m, of a strip 6 m wide
    assert dark == pytest.approx(4 + height * np.tan(np.deg2rad(look)), abs=0.02)  # 4 m lie under it


@pytest.mark.parametrize("lines", quick_of([16, 256], [16, 64, 256]))
def test_a_large_facet_half_in_shadow_returns_its_lit_share(lines):
    random = np.random.default_rng(4)
    errors = []
    for _ in range(60):
        triangle = np.pad(random.uniform(-5, 5, (3, 2)), ((0, 0), (0, 1)))
        if areas(triangle[None])[0] < 3:
            continue
        turn = random.uniform(0, 2 * np.pi)
        across, along = np.array([np.cos(turn), np.sin(turn)]), np.array([-np.sin(turn), np.cos(turn)])
        at = random.dirichlet([1, 1, 1]) @ triangle[:, :2]
        screen = np.array(
            [at - 99 * along, at + 99 * along, at + 99 * along + 99 * across, at - 99 * along + 99 * across]
        )
        raised = np.pad(screen, ((0, 0), (0, 1)), constant_values=2.0)
        scene = np.stack([triangle, raised[[0, 1, 2]], raised[[0, 2, 3]]])
        share = shares(scene, [0, 0, 1e7], lines=lines)[0]
        # the outline must run counter-clockwise
        wanted = 1 - area_within(triangle[:, :2], screen[::-1]) / areas(scene[:1])[0]
        errors.append(abs(share - wanted))
    # a sample at either end of each line that the edge crosses, 1/255 of a root, and the lift's displacement
    assert len(errors) > 25 and max(errors) < 1 / (2 * lines) + 1 / 255 + 0.004


@pytest.mark.parametrize("lines", [16, 64])
def test_sample_points_fill_triangles_evenly(lines):
    """Behind any straight edge the share of points is the share of area, within a line."""
    points = sample_points(lines)
    assert points.shape == (lines * PER_LINE, 2) and (points > 0).all() and (points.sum(axis=1) < 1).all()
    worst, n = 0.0, len(points)
    for angle in np.linspace(0, 2 * np.pi, 1001):
        way = np.array([np.cos(angle), np.sin(angle)])
        q = np.sort(points @ way)
        a, b, c = np.sort([0, *way])
        with np.errstate(divide="ignore", invalid="ignore"):
            area = np.where(q < b, (q - a) ** 2 / ((b - a) * (c - a)), 1 - (c - q) ** 2 / ((c - a) * (c - b)))
        worst = max(worst, np.abs(area - np.arange(n) / n).max(), np.abs(area - np.arange(1, n + 1) / n).max())
    assert 0.4 / lines < worst <= 1 / lines


def test_a_sliver_that_no_line_of_samples_meets_is_neither_whole_nor_dark(device):
    """A corner in shadow, or in light, makes a facet partly lit: its power is not lost."""
    facet = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    at_a_corner = np.array([[-9.0, -9, 1], [9, -9, 1], [0.0, 0.004, 1]])
    but_a_strip = np.array([[-30.0, 0.004, 1], [30, 0.004, 1], [0, 90, 1]])
    for occluder, low, high in ((at_a_corner, 0.995, 1), (but_a_strip, 0, 0.005)):
        look = IlluminationSolver(device, np.stack([facet, occluder])).look([np.array([0, 0, 1e7])])
        assert look.partly.tolist() == [0] and low < look.halves[0].sum() / (2 * look.samples) < high


def test_shares_are_those_of_the_reference_in_a_soup(device):
    random = np.random.default_rng(8)
    soup = random.uniform(-5, 5, (40, 1, 3)) + 2 * random.standard_normal((40, 3, 3))
    for viewpoint in (eye(20, 50), np.array([1.0, 0.5, -0.2]), eye(100, 80, 14)):
        wanted = 1 - hidden(soup, viewpoint, sample_points(16)).mean(axis=1)
        inside = np.linalg.norm(viewpoint) < 20  # a ray for eight samples there
        found = np.sqrt(shares(soup, viewpoint, device))
        assert found == pytest.approx(np.sqrt(wanted), abs=0.13 if inside else 0.51 / 255)


def test_from_near_too_an_edge_across_all_lines_falls_between_their_samples(device):
    """A shadow that covers the same part of every line: four rays on each of 16 lines tell it to 1/32."""
    facet = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    for seen in np.linspace(0.04, 0.96, 24):
        way = np.array([seen, -1.0]) / np.hypot(seen, 1)
        begin, end = np.array([0, 1.0]) - 9 * way, np.array([0, 1.0]) + 9 * way
        screen = np.pad([begin, end, begin + end + 9], ((0, 0), (0, 1)), constant_values=1e-4)
        share = shares(np.stack([facet, screen]), [0.3, 0.3, 2.0], device)[0]
        assert share == pytest.approx(seen, abs=1 / 32)


def test_a_viewpoint_in_a_room_sees_its_walls_but_not_behind_a_partition(device):
    walls = trimesh.creation.box((10, 10, 10)).subdivide().subdivide().triangles
    partition = np.array([[[2.0, -4.9, -4.9], [2, 4.9, -4.9], [2, 0, 4.9]]])
    scene = np.concatenate([walls, partition])
    share = shares(scene, [-1, 0.3, 0.2], device)
    near = walls[:, :, 0].max(axis=1) <= 2
    assert (share[:-1][near] == 1).all() and share[-1] == 1
    behind = walls[:, :, 0].min(axis=1) >= 2
    covered = behind & (np.abs(walls[:, :, 1]) < 2.6).all(axis=1) & (np.abs(walls[:, :, 2]) < 2.6).all(axis=1)
    assert covered.sum() == 8 and (share[:-1][covered] == 0).all()
    assert (shares(walls, [-1, 0.3, 0.2], device) == 1).all()


def test_facets_facing_away_are_dark_from_one_side_only():
    roof = np.array([[[-1, -1, 0], [1, -1, 0], [0, 1, 0.0]]])
    above, below = eye(0, 20), -eye(0, 20)
    assert shares(roof, above, two_sided=False) == 1 and shares(roof, below, two_sided=False) == 0
    assert shares(roof, above) == 1 and shares(roof, below) == 1


def test_shares_do_not_depend_on_order_chunks_or_device(device):
    """More facets than one call of the kernels takes, 65 536: another order puts others into the second call."""
    random = np.random.default_rng(2)
    scene = np.concatenate(
        [ground(185), BODIES["frustum"].triangles, BODIES["cylinder"].triangles + np.array([9, 3, 0])]
    )
    viewpoint, order = eye(33, 62), random.permutation(len(scene))
    wanted = shares(scene, viewpoint)
    assert (shares(scene, viewpoint, device) == wanted).all() and 0.05 < (wanted < 1).mean() < 0.5
    assert len(scene) > 66_000 and (shares(scene[order], viewpoint, device) == wanted[order]).all()


def test_fine_facets_get_the_shares_that_all_samples_give():
    """Corners and centre find every facet on the edge of a shadow that is wider than facets are."""
    scene = np.concatenate([ground(60), BODIES["frustum"].triangles])
    some = shares(scene, eye(12, 55), two_sided=False)
    finer = ground(60, size=0.5) + np.array([100.0, 0, 0])  # beside these every facet is large, and gets all samples
    full = shares(np.concatenate([scene, finer]), eye(12, 55), two_sided=False)[: len(scene)]
    assert np.abs(some - full).max() <= 1 / 16 and ((full > 0) & (full < 1)).sum() > 20


def test_a_large_facet_among_fine_ones_holds_a_whole_shadow():
    """Neither its corners nor its centre are in the shadow: all its samples are looked at."""
    plate = np.array([[[-10.0, -10, 0], [10, -10, 0], [-10, 10, 0]]])
    lid = ground(60, 6.0) + np.array([-6.0, 0.0, 3.0])
    share = shares(np.concatenate([plate, lid]), [-6.0, 0, 1e7])
    assert len(lid) > _frame.FEW and share[0] == pytest.approx(1 - 36 / 200, abs=1 / 16) and (share[1:] == 1).all()


def circle(n, radius=7e3, height=7e3, arc=2 * np.pi):
    a = np.linspace(0, arc, n, endpoint=False)
    return np.stack([radius * np.cos(a), radius * np.sin(a), np.full(n, height)], axis=1)


def straight(n, length=100.0):
    return np.stack([np.linspace(-length / 2, length / 2, n), np.full(n, -7e3), np.full(n, 7e3)], axis=1)


def pole(height=6.0):
    return trimesh.creation.box((0.8, 0.8, height)).triangles + np.array([0, 0, height / 2])


def test_a_short_straight_track_is_one_block_a_circle_many():
    scene = np.concatenate([ground(), pole()])
    assert len(lit(scene, straight(1000), two_sided=False)) == 1
    tx = circle(1000)
    bounds = box(scene.reshape(-1, 3))
    offered = len(pulse_blocks([tx], bounds, [0.25 * projected_width(scene, tx[500]) / shadow_length(bounds, tx)])[0])
    assert 100 < offered < 500
    assert offered / 8 < len(lit(scene, tx, two_sided=False)) < offered / 2  # not all of them need a look
    assert len(lit(ground(), circle(1000), two_sided=False)) == 1  # nothing stands above the ground


@pytest.mark.parametrize("track", ["straight", "circle", "jitter", "back and forth", "still", "over"])
def test_directions_within_a_block_differ_by_no_more_than_the_limit(track):
    random = np.random.default_rng(3)
    tx = {
        "straight": straight(2000, 3e3),
        "circle": circle(3000),
        "jitter": straight(500, 900.0) + 30 * random.standard_normal((500, 3)),
        "back and forth": np.concatenate([straight(300, 2e3), straight(300, 2e3)[::-1]]),
        "still": np.repeat(eye(0, 40)[None], 50, axis=0),
        "over": np.stack([np.linspace(-60, 60, 400), np.zeros(400), np.full(400, 25.0)], axis=1),
    }[track]
    bounds, limit = np.array([[-20, -20, 0], [20, 20, 6.0]]), 0.01
    blocks, looks, turns = pulse_blocks([tx], bounds, [limit])
    assert blocks[0, 0] == 0 and blocks[-1, 1] == len(tx) and (blocks[1:, 0] == blocks[:-1, 1]).all()
    points = random.uniform(*bounds, (30, 3))
    worst = 0.0
    for (first, last), look, turn in zip(blocks, looks, turns, strict=True):
        assert first <= look < last
        way = tx[first:last, None] - points
        way /= np.linalg.norm(way, axis=2, keepdims=True)
        moved = np.linalg.norm(way - way[look - first], axis=2).max()
        assert moved <= turn + 1e-12 and turn <= limit
        worst = max(worst, moved)
    if track in ("straight", "circle"):
        assert worst > 0.8 * limit and len(blocks) < 1.3 * np.ceil(total_turn(tx) / (2 * limit))


def block_at(found, pulse):
    return int(np.searchsorted(found.blocks[:, 0], pulse, side="right")) - 1


def total_turn(tx):
    """Way of the direction from the origin, rad."""
    way = tx / np.linalg.norm(tx, axis=1, keepdims=True)
    return np.linalg.norm(np.diff(way, axis=0), axis=1).sum()


@pytest.mark.parametrize("tolerance", [0.25, 0.0625])
def test_a_sweeping_poles_shadow_is_right_at_every_pulse_within_the_bound(tolerance):
    scene, tx = np.concatenate([ground(30, 24), pole()]), circle(700, arc=0.5)
    light = IlluminationSolver(open_device(), scene, two_sided=False)
    bounds = box(scene.reshape(-1, 3))
    typical, way = projected_width(scene, tx[350]), shadow_length(bounds, tx)
    blocks, viewpoints, _ = pulse_blocks([tx], bounds, [tolerance * typical / way])
    assert len(blocks) > 5
    u = tx[350] / np.linalg.norm(tx[350])
    own = areas(scene) * np.abs(normals(scene) @ u) / np.linalg.norm(scene - np.roll(scene, 1, 1), axis=2).max(axis=1)
    floor = np.arange(len(scene)) < 1800
    worst = 0.0
    for pulse in range(0, 700, 23):
        block = int(np.searchsorted(blocks[:, 0], pulse, side="right")) - 1
        assert blocks[block, 0] <= pulse < blocks[block, 1]
        moved = np.abs(light.share([tx[pulse]]) / 255.0 - light.share([tx[viewpoints[block]]]) / 255.0)
        # two samplings, and two edges of a shadow narrower than a facet
        assert (moved[floor] <= 2 * tolerance * typical / own[floor] + 2 / 16).all()
        worst = max(worst, moved[floor].max())
    assert worst > 0 and way == pytest.approx(6 * np.sqrt(2), rel=5e-3)
    # one viewpoint for all of them would be far off
    assert np.abs(light.share([tx[0]]) - 1.0 * light.share([tx[-1]])).max() == 255


def test_shares_change_evenly_between_the_pulses_looked_from():
    scene, tx = np.concatenate([ground(30, 24), pole()]), circle(700, arc=0.5)
    found = lit(scene, tx, two_sided=False, tolerance=0.5)
    light = IlluminationSolver(open_device(), scene, two_sided=False)
    spans = list(found.spans())
    assert [s.first for s in spans] == [0, *(s.stop for s in spans[:-1])] and spans[-1].stop == len(tx)
    assert len(found) - 1 <= len(spans) <= len(found) + 1
    even = stepped = 0.0
    for span in spans:
        for pulse in range(span.first, span.stop, 17):
            part = span.moments(np.array([pulse]))[0]
            share = ((span.level + part * (span.later - 1.0 * span.level)) / 255) ** 2
            assert share == pytest.approx(found.fraction_at(pulse), abs=1e-6)
            true = light.share([tx[pulse]]) / 255.0
            even += ((share - true) ** 2).sum()
            stepped += ((found.fraction(block_at(found, pulse)) - true) ** 2).sum()
    assert even < 0.7 * stepped  # the rest is that shares are counted in samples
    for block, pulse in enumerate(found.viewpoints):
        assert (found.fraction_at(pulse) == found.fraction(block)).all()
    still = next(lit(scene, tx[:1], two_sided=False).spans())
    assert (still.first, still.stop) == (0, 1) and still.later is still.level


def refined(levels, at, limit):
    """What refine_viewpoints finds of levels (n, k) at pulses (n,), the viewpoints that were looked at whole, and the
    shares of facets that the others were looked at for."""
    whole, seen, made, most = [], [0.0], {}, 255.0**2 * levels.shape[1]

    def look(place, partial):
        if partial is None:
            whole.append(place)
            made.pop(place, None)
            return levels[place]
        looked = partial.facets | partial.known
        seen.append(looked.mean())
        if looked.all():
            whole.append(place)
        even = between_two(partial.before, partial.after, place)
        assert (np.abs(partial.levels - even) <= 0.5)[~looked].all() and not (partial.facets & partial.known).any()
        assert (partial.levels == levels[place])[partial.known].all()
        made[place] = np.where(partial.facets, levels[place], partial.levels)
        return made[place]

    def between_two(a, b, place):
        one, two = (made.get(at, levels[at]).astype(float) for at in (a, b))
        return one + (two - one) * (at[place] - at[a]) / (at[b] - at[a])

    def squares(found, first, last, part, some):
        return (found[some] - (first[some] + part * (last[some] - first[some].astype(float)))) ** 2 / most

    found = list(refine_viewpoints(look, at, np.zeros(1, int), squares, lambda: limit))
    assert [place for place, *_ in found] == sorted({place for place, *_ in found})
    return found, whole, seen


def looked_at(levels, at, limit):
    """Viewpoints, those that were looked at whole, and the mean squares left."""
    found, whole, _ = refined(levels, at, limit)
    return [place for place, *_ in found], whole, [left for *_, left in found]


def test_where_levels_hardly_change_every_128th_block_and_halfway_are_looked_at():
    levels, at = np.zeros((400, 500), np.uint8), 3 * np.arange(400)
    levels[:, 0] = 255
    few = [0, 64, 128, 192, 256, 320, 384, 391, 399]
    places, whole, left = looked_at(levels, at, 1e-6)
    assert places == sorted(whole) == few and left == [0] * 9
    levels[:, 1:20] = (np.arange(400) // 2)[:, None]  # even change
    assert looked_at(levels, at, 1e-4)[0] == few
    levels[150:200, 30] = 255  # an occlusion in some pulses only: viewpoints are added until it is resolved
    places, whole, left = looked_at(levels, at, 1e-5)
    assert {149, 150, 199, 200} <= set(places) and len(places) < 60 and max(left) <= 1e-3
    assert len(whole) < len(places)  # the others were looked at in part
    for n in (1, 2, 3):
        assert looked_at(levels[:n], at[:n], 1e-6)[0] == list(range(n))


def test_few_looks_at_many_facets_are_spread_evenly(monkeypatch):
    monkeypatch.setattr(illumination, "MUCH", 1.0)
    found = lit(np.concatenate([ground(20), pole()]), circle(400), two_sided=False, accuracy=0.9)
    gaps = np.diff(found.viewpoints)
    assert 3 < len(gaps) < 40 and gaps.max() <= 1.5 * gaps.min()


def test_facets_that_change_between_looks_alone_are_not_left_out():
    """A thin shadow that crosses each facet between the first looks: whole looks go on until it is seen twice."""
    pulses, facets = np.arange(257)[:, None], np.arange(600)
    levels = np.where(np.abs(pulses - facets * 257 / 600) < 1.5, 0, 255).astype(np.uint8)
    places, whole, left = looked_at(levels, np.arange(257), 1e-5)
    assert len(places) == 257 and len(whole) > 60
    step = np.diff(places, prepend=0)
    assert np.sqrt(step @ left / 256) < 0.05


def crossed_by_edges(pulses, n, seed, width):
    """Levels (pulses, n) of facets that the edge of a shadow crosses at some time, in `width` pulses."""
    random = np.random.default_rng(seed)
    start = random.uniform(-pulses, pulses, n)
    share = np.clip((np.arange(pulses)[:, None] - start) / width, 0, 1)
    return np.rint(255 * np.sqrt(np.where(random.random(n) < 0.5, share, 1 - share))).astype(np.uint8)


@pytest.mark.parametrize("width, limit", thinned([2, 60, 12], [1e-4, 1e-5]))
def test_facets_that_change_evenly_are_left_out_within_the_limit(width, limit):
    levels = crossed_by_edges(257, 30_000, 1, width)
    found, whole, seen = refined(levels, np.arange(257), limit)
    places = [place for place, *_ in found]
    true, off = levels.astype(float), 0.0
    for (a, first, _), (b, last, _) in pairwise(found):
        part = (np.arange(a, b)[:, None] - a) / (b - a)
        off += (((1 - part) * first + part * last - true[a:b]) ** 2).sum()
    assert off / (257 * 30_000 * 255.0**2) <= 1.5 * limit + 1 / (12 * 255.0**2)
    assert len(whole) < len(places) or len(places) == 257
    assert min(seen) < 0.4


def test_lighting_distinguishes_dark_full_and_changing_facets(device):
    scene, tx = np.concatenate([ground(20), pole()]), circle(90)
    found = lit(scene, tx, two_sided=False, tolerance=0.25, device=device)
    all_of_them = np.array([found.share(i) for i in range(len(found))])
    assert (found.dark == (all_of_them == 0).all(axis=0)).all() and 2 <= found.dark.sum() < 30
    assert (found.full == (all_of_them == 255).all(axis=0)).all() and 500 < found.full.sum() < 800
    assert (found.dark_facets == (all_of_them == 0).sum(axis=1)).all()
    assert found.fraction(0).dtype == np.float32 and found.fraction(-1).max() == 1


def test_shares_that_do_not_fit_are_found_anew():
    scene, tx = np.concatenate([ground(20), pole()]), circle(60)
    kept, anew = lit(scene, tx, two_sided=False), lit(scene, tx, two_sided=False, max_bytes=1000)
    assert len(anew._changes) < len(anew) == len(kept) == len(kept._changes)
    assert all((kept.share(i) == anew.share(i)).all() for i in range(len(kept)))
    assert sum(i.nbytes + v.nbytes for i, v in anew._changes) <= 1000


def test_two_antennas_must_both_see_a_facet(device):
    scene, rx = np.concatenate([ground(30), pole()]), eye(80, 40)[None]
    for azimuth in (0, 10):
        tx = eye(azimuth, 50)[None]
        both = lit(scene, tx, rx, device=device).share(0)
        one, other = (lit(scene, e, device=device).share(0).astype(int) for e in (tx, rx))
        # from azimuth 0, two faces of the pole lie in planes 4e-5 rad off the transmitter: the receiver tells the side
        edge_on = np.abs(normals(scene) @ unit(tx[0])) < 1e-3
        assert edge_on.sum() == (0 if azimuth else 4) and (both == other)[edge_on].all()
        assert (both <= np.minimum(one, other))[~edge_on].all()
        assert (both >= one + other - 257)[~edge_on].all()
        assert (both != one).any() and ((both != other).any() or not azimuth)
    # shadows that cover different halves of a facet leave nothing of it
    plate = np.array([[[-1, -1, 0], [1, -1, 0], [0, 1, 0.0]]])
    wall = np.array([[[0, -9, 0.05], [0, 9, 0.05], [0, 0, 30.0]]])
    left, right = np.array([[-1e4, 0, 2e3]]), np.array([[1e4, 0, 2e3]])
    halves = [lit(np.concatenate([plate, wall]), *e, tolerance=1 / 16).share(0)[0] / 255 for e in ((left,), (right,))]
    joint = lit(np.concatenate([plate, wall]), left, right, tolerance=1 / 16).share(0)[0] / 255
    assert 0.3 < min(halves) and max(halves) < 1 and joint == pytest.approx(sum(halves) - 1, abs=1.5 / 255)


def test_from_near_a_facet_that_one_antenna_sees_whole_is_no_lighter_than_for_the_other(device):
    plate = np.array([[[-1, -1, 0], [1, -1, 0], [0, 1, 0.0]]])
    lid = np.array([[[-9, -9, 0.1], [0, -9, 0.1], [0, 9, 0.1]]])
    solver = IlluminationSolver(device, np.concatenate([plate, lid, lid + np.array([0, 0, 20.0])]), two_sided=True)
    solver.take_lines(64)
    over, aside = np.array([0.0, 0.0, 5.0]), np.array([4.0, 0.0, 0.05])
    alone, both = (solver.look(eyes) for eyes in ([over], [over, aside]))
    assert both.by_rays.all() and solver.look([aside]).levels[0] == 255
    assert both.levels[0] == alone.levels[0] == pytest.approx(255 * np.sqrt(0.5), abs=4)


def test_occluders_hide_the_facets_alone_that_they_may_hide():
    facets, over = ground(20), np.arange(800) % 3 > 0
    parts = Occlusion(ground(20), np.ones(800, bool)), Occlusion(pole(), over)
    some = IlluminationSolver(open_device(), facets, occlusions=parts).share([eye(0, 50)])
    hidden = IlluminationSolver(open_device(), np.concatenate([facets, pole()])).share([eye(0, 50)])[:800]
    assert (some[over] == hidden[over]).all() and (some[~over] == 255).all() and (hidden[~over] < 255).any()


def test_a_scene_wholly_in_shadow_is_reported():
    with pytest.warns(sarcl.SarclWarning, match="check the side the track is on"):
        lit(ground(6, 4.0), -eye(0, 40)[None], two_sided=False)


@pytest.mark.parametrize(
    "change, message",
    [
        ({"tx": np.zeros((0, 3))}, "tx is empty"),
        ({"tx": np.zeros(3)}, r"tx has shape \(3,\)"),
        ({"tx": np.full((1, 3), np.nan)}, "tx.* is nan"),
        ({"rx": np.zeros((2, 3))}, r"rx has shape \(2, 3\), wanted \(1, 3\)"),
        ({"tolerance": 0.0}, "tolerance is 0"),
        ({"accuracy": 0.0}, "accuracy is 0"),
        ({"two_sided": np.ones(3, bool)}, r"two_sided has shape \(3,\); wanted one for each of 8 facets"),
    ],
)
def test_bad_input_is_refused(change, message):
    arguments = {"triangles": ground(2), "tx": eye(0, 30)[None]} | change
    with pytest.raises(ValueError, match=message):
        lit(arguments.pop("triangles"), arguments.pop("tx"), **arguments)


def test_no_facet_is_lit_too():
    none = lit(np.zeros((0, 3, 3)), circle(5))
    assert len(none) == 1 and none.share(0).shape == (0,) and (none.blocks == [0, 5]).all()


def test_facets_that_turn_towards_the_antenna_between_viewpoints_are_lit():
    """300 plates that hide nothing of one another, seen from an arc, which is divided into few blocks."""
    random, k = np.random.default_rng(0), 300
    normal = unit(random.normal(size=(k, 3)))
    along = unit(np.cross(normal, random.normal(size=(k, 3))))
    across = np.cross(normal, along)
    place = 40.0 * np.stack([np.arange(k) % 18, np.arange(k) // 18, np.zeros(k)], axis=1)
    triangles = np.stack(
        [place + 8 * along, place - 4 * along + 7 * across, place - 4 * along - 7 * across], axis=1
    )  # fmt: skip
    angle = np.linspace(-0.8, 0.8, 801)
    track = 60e3 * np.stack([np.cos(angle), np.sin(angle), 0.5 + 0 * angle], axis=1)
    made = lit(triangles, track, two_sided=False)
    assert len(made) < 100
    for pulse in range(0, 801, 9):
        facing = (unit(track[pulse] - place) * normals(triangles)).sum(axis=1)
        assert (made.fraction_at(pulse)[facing > 1e-3] > 0.99).all()

"""Facets that are joined before beams are followed, and closed bodies of which only the lit side shades."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from helpers.cases import planned_within

import sarcl
from sarcl.base.errors import NothingSeen
from sarcl.simulation.bounces.bounce_spreader import BeamLimits, BounceScene

CHIRP = sarcl.Waveform.chirp(center=9.6e9, bandwidth=50e6, duration=1e-6)
PLATES = np.array(
    [[(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], [(0, 0, 0), (0, 1, 0), (0, 1, 1), (0, 0, 1)]], float
)  # a dihedral
LOOK = sarcl.Trajectory(None, np.array([[1e3, 40, 1e3]]))


def halves(quads: np.ndarray) -> np.ndarray:
    """Two triangles of each quadrilateral (k, 4, 3)."""
    return quads[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3, 3)


def block(low: tuple[float, float, float], high: tuple[float, float, float]) -> np.ndarray:
    """Twelve triangles of a closed box, turned outwards."""
    a, b = np.array(low), np.array(high)
    corner = np.array([np.where([i & 1, i & 2, i & 4], b, a) for i in range(8)])
    return halves(corner[[(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]])


def echo(scene: sarcl.Scene, track: sarcl.Trajectory = LOOK) -> sarcl.PhaseHistory:
    options = {"reference": (0.5, 0.5, 0.5), "range_window": (-5, 5), "tolerance": 1e-2, "check": False}
    return sarcl.echo(scene, CHIRP, track, bounces=2, **options)


def number_of_two(raw: sarcl.PhaseHistory) -> int:
    """Echoes of two reflections that a report counts."""
    counts = dict(part.split(": ") for part in str(raw.report.plan["contributions by reflections"]).split(", "))
    return int(counts["2"])


@pytest.mark.parametrize("turn", [0.0, 0.4])
def test_halves_of_a_rectangle_reflect_as_one_facet(turn):
    c, s = np.cos(turn), np.sin(turn)
    axes = np.array([(c, -s, 0), (s, c, 0), (0, 0, 1)])
    assert number_of_two(echo(sarcl.Scene.facets(halves(PLATES) @ axes.T))) == 2


def test_facets_of_different_materials_and_halves_that_are_not_flat_stay_apart():
    triangles = halves(PLATES)
    mixed = sarcl.Scene.facets(triangles, material=[0, 1, 0, 0], materials=["metal", sarcl.Material(4.0 - 0.2j)])
    assert number_of_two(echo(mixed)) > 2
    triangles[0, 1] += (0, 0, 1e-4)
    assert number_of_two(echo(sarcl.Scene.facets(triangles))) > 2


def test_a_quadrilateral_with_a_reflex_corner_stays_two_triangles():
    dart = PLATES.copy()
    dart[0, 1] = (0.3, 0.4, 0)  # inside the line from one neighbour to the other
    dart[0, 2], dart[0, 3] = (1, 1, 0), (0, 1, 0)
    kite = dart[0][[[0, 1, 3], [1, 2, 3]]]
    assert number_of_two(echo(sarcl.Scene.facets(np.concatenate([kite, halves(PLATES[1:])])))) > 2


def test_a_closed_body_shades_as_the_same_body_with_open_edges():
    body = block((0.4, 0.2, 0.0), (0.7, 0.6, 0.4))
    center = body.mean(axis=1, keepdims=True)
    closed, open_ = (np.concatenate([halves(PLATES), center + share * (body - center)]) for share in (1.0, 1.0 - 1e-7))
    two_sided = np.repeat([True, False], (4, 12))
    values = [echo(sarcl.Scene.facets(one, two_sided=two_sided)).samples for one in (closed, open_)]
    free = echo(sarcl.Scene.facets(halves(PLATES), two_sided=np.ones(4, bool))).samples
    assert np.linalg.norm(values[0] - values[1]) <= 1e-2 * np.linalg.norm(values[1])
    assert np.linalg.norm(free - values[1]) > 0.1 * np.linalg.norm(free)  # it hides a part


def test_nothing_outside_is_lit_from_inside_a_body():
    place = LOOK.positions[0]
    body = block(tuple(place - 1), tuple(place + 1))
    scene = sarcl.Scene.facets(np.concatenate([halves(PLATES), body]), two_sided=np.repeat([True, False], (4, 12)))
    with pytest.raises(NothingSeen):  # but the walls about the antenna, outside the range window
        echo(scene)


def test_a_room_of_two_sided_facets_reflects_to_an_antenna_within():
    room = sarcl.Scene.facets(block((-8, -8, -8), (9, 9, 9)), two_sided=True)
    wave = sarcl.Waveform.chirp(center=100e6, bandwidth=5e6, duration=1e-6)
    track = sarcl.Trajectory(None, np.array([[0.4, 0.3, 0.2]]))
    options = {"reference": (0.5, 0.5, 0.5), "range_window": (-1, 30), "tolerance": 1e-1, "check": False}
    assert number_of_two(sarcl.echo(room, wave, track, bounces=2, **options)) > 0


def grid(corner: tuple[float, float, float], u: np.ndarray, v: np.ndarray, n: int) -> np.ndarray:
    """n x n x 2 triangles of a parallelogram at a corner."""
    i, j = (k.ravel() for k in np.meshgrid(np.arange(n), np.arange(n)))
    at = [
        np.array(corner) + np.outer(a / n, u) + np.outer(b / n, v)
        for a, b in ((i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1))
    ]
    return halves(np.stack(at, axis=1))


def dihedral_cut(n: int, cells: slice = slice(None)) -> sarcl.Scene:
    """The dihedral, its ground of n x n squares, of which `cells` are there, and its wall of n x n."""
    x, y, z = np.eye(3)
    ground = grid((0, 0, 0), x, y, n).reshape(-1, 2, 3, 3)[cells].reshape(-1, 3, 3)
    return sarcl.Scene.facets(np.concatenate([ground, grid((0, 0, 0), y, z, n)]))


def test_a_finely_cut_dihedral_reflects_as_one_of_two_facets():
    whole, fine = echo(sarcl.Scene.facets(halves(PLATES))), echo(dihedral_cut(24))
    assert number_of_two(fine) == number_of_two(whole) == 2
    assert np.linalg.norm(fine.samples - whole.samples) <= 1e-3 * np.linalg.norm(whole.samples)


def test_flat_parts_with_a_hole_or_t_junctions_are_joined_to_few_facets():
    n = 8
    hole = np.setdiff1d(np.arange(n * n), np.add.outer(n * np.arange(2, 5), np.arange(3, 6)))
    fine, single = dihedral_cut(n, hole), dihedral_cut(n, hole).triangles.copy()
    single += 1e-6 * np.random.default_rng(1).normal(size=single.shape)  # not flat: nothing is joined
    joined, apart = echo(fine), echo(sarcl.Scene.facets(single))
    assert number_of_two(joined) <= 2 * 6 < number_of_two(apart)
    assert np.linalg.norm(joined.samples - apart.samples) <= 1e-2 * np.linalg.norm(apart.samples)
    # a vertex within an edge of a larger triangle: areas are counted once
    wall = np.concatenate(
        [grid((0, 0, 0), np.array([0, 1, 0]), np.array([0, 0, 0.5]), 3), halves(PLATES[1:]) * (1, 1, 0.5) + (0, 0, 0.5)]
    )
    steps = echo(sarcl.Scene.facets(np.concatenate([halves(PLATES[:1]), wall])))
    assert np.linalg.norm(steps.samples - echo(sarcl.Scene.facets(halves(PLATES))).samples) <= 1e-2 * np.linalg.norm(
        steps.samples
    )


def test_flat_parts_rounded_to_float32_are_joined_wherever_they_stand():
    c, s = np.cos(0.4), np.sin(0.4)
    turn = np.array([(c, -s, 0), (s, c, 0), (0, 0, 1)]) @ np.array([(1, 0, 0), (0, c, -s), (0, s, c)])
    exact = dihedral_cut(6).triangles @ turn.T
    place, options = np.array([1e3, 0, 0]), {"range_window": (-5, 5), "tolerance": 1e-2, "check": False, "bounces": 2}
    track = sarcl.Trajectory(None, LOOK.positions @ turn.T + place)
    flat, rounded = (
        sarcl.echo(sarcl.Scene.facets(one + place), CHIRP, track, reference=place, **options)
        for one in (exact, exact.astype(np.float32).astype(float))
    )
    assert number_of_two(rounded) == number_of_two(flat) == 2
    assert np.linalg.norm(rounded.samples - flat.samples) <= 1e-3 * np.linalg.norm(flat.samples)


def test_a_gently_bent_mesh_is_joined_no_farther_than_the_tolerance_allows():
    bent = dihedral_cut(12).triangles.copy()
    bent[: 144 * 2, :, 2] += (
        2e-4 * bent[: 144 * 2, :, 0] ** 2
    )  # neighbours differ by 3e-6 m, all by 5e-5 m from a plane
    scene = sarcl.Scene.facets(bent)
    options = {"reference": (0.5, 0.5, 0.5), "range_window": (-5, 5), "check": False, "bounces": 2}
    loose, fine = (sarcl.echo(scene, CHIRP, LOOK, tolerance=t, **options) for t in (1e-1, 1e-3))
    assert number_of_two(loose) < number_of_two(fine)
    assert np.linalg.norm(loose.samples - fine.samples) <= 1e-1 * np.linalg.norm(fine.samples)


def test_a_mesh_of_facets_narrower_than_a_wavelength_is_said():
    bent = dihedral_cut(40).triangles + 0.0
    bent[..., 2] += 0.05 * bent[..., 0] ** 2
    with pytest.warns(
        sarcl.SarclWarning, match=r"mesh too fine for bounces=2: .* narrower than the wavelength.*coarser"
    ):
        raw = echo(sarcl.Scene.facets(bent))
    assert "of the area" in str(raw.report.plan["facets narrower than a wavelength"])


def test_what_is_at_the_edge_of_a_beam_shades_it_at_all_pulses_of_a_block():
    """Posts beside a dihedral, whose shadows move over it between pulses that are looked at together."""
    rng, n = np.random.default_rng(5), 40
    posts = np.concatenate(
        [
            block(tuple(p), tuple(np.add(p, (0.02, 0.02, 0.5))))
            for p in rng.uniform((0, 0, 0.1), (1.2, 1.2, 0.5), (n, 3))
        ]
    )
    scene = sarcl.Scene.facets(np.concatenate([halves(PLATES), posts]), two_sided=np.repeat([True, False], (4, 12 * n)))
    angle = np.linspace(-0.02, 0.02, 5)
    places = 1e3 * np.stack([np.cos(angle), 0.04 + np.sin(angle), 1 + 0 * angle], axis=1)
    together = echo(scene, sarcl.Trajectory(np.arange(5) / 100, places)).samples
    apart = [echo(scene, sarcl.Trajectory(None, place[None])).samples for place in places]
    assert np.linalg.norm(together - np.concatenate(apart)) <= 1e-6 * np.linalg.norm(together)


def limit(monkeypatch, **limits):
    """Let beams be looked for within other limits."""
    prepare = vars(BounceScene)["of"].__func__
    function = classmethod(lambda *values: replace(prepare(*values), limits=BeamLimits(**limits)))
    monkeypatch.setattr(BounceScene, "of", function)


@pytest.mark.parametrize("bounces", [2, 3])
def test_shadows_on_single_facets_looked_at_first_change_nothing(bounces, monkeypatch):
    rng = np.random.default_rng(7)
    triangles = np.concatenate(
        [halves(PLATES), 0.5 + rng.uniform(-0.4, 0.4, (24, 1, 3)) + rng.uniform(-0.2, 0.2, (24, 3, 3))]
    )
    scene = sarcl.Scene.facets(triangles, two_sided=rng.random(len(triangles)) < 0.7)
    samples, receiver = [], sarcl.Trajectory(None, np.array([[900, 300, 1.1e3]]))
    for many in (0, 1000):
        limit(monkeypatch, many=many)
        samples += [
            sarcl.echo(
                scene, CHIRP, LOOK, receiver=other, bounces=bounces, reference=(0.5, 0.5, 0.5), range_window=(-9, 9),
                tolerance=1e-2, check=False,
            ).samples
            for other in (None, receiver)
        ]  # fmt: skip
    for first, second in zip(samples[:2], samples[2:], strict=True):
        assert np.linalg.norm(first - second) <= 1e-6 * np.linalg.norm(second)


@pytest.mark.parametrize("prepared_seconds", [0.0, np.inf])
def test_too_many_pairs_of_facets_are_refused_by_a_plan_and_a_run_alike(monkeypatch, prepared_seconds):
    limit(monkeypatch, most_ways=1)
    limits = {"prepared_seconds": prepared_seconds, "prepared_share": 0.0}
    options = {"reference": (0.5, 0.5, 0.5), "range_window": (-5, 5), "tolerance": 1e-2, "bounces": 2}
    scene, texts = sarcl.Scene.facets(halves(PLATES)), []
    plan = planned_within(limits, sarcl.echo, scene, CHIRP, LOOK, **options)
    for call in (plan.forecast, lambda: echo(scene)):
        with pytest.raises(MemoryError, match=r"about 2e\+00 ways, more than the 1e.*fewer bounces, a coarser") as said:
            call()
        texts.append(str(said.value))
    assert texts[0] == texts[1]


@pytest.mark.parametrize("most_pairs", [1, 40])
def test_beams_in_many_blocks_have_the_echoes_of_one_block_and_few_weak_ones(monkeypatch, most_pairs):
    """Concrete blocks, whose beams of the last order are left out as far as a share of the tolerance goes."""
    rng = np.random.default_rng(3)
    places = rng.uniform((0, 0, 0.05), (1.5, 1.5, 0.6), (4, 3))
    triangles = np.concatenate([halves(PLATES), *(block(tuple(p), tuple(p + 0.3)) for p in places)])
    scene = sarcl.Scene.facets(triangles, material="concrete")
    options = {"bounces": 3, "reference": (0.5, 0.5, 0.5), "range_window": (-9, 9), "check": False}
    exact = sarcl.echo(scene, CHIRP, LOOK, tolerance=1e-4, **options).samples
    skipped, pairs = [], []
    for most in (most_pairs, 10**7):
        limit(monkeypatch, most_pairs=most)
        raw = sarcl.echo(scene, CHIRP, LOOK, tolerance=3e-1, **options)
        skipped.append(raw.report.contributions_skipped["weak reflections"])
        pairs.append(raw.report.contributions_done + sum(raw.report.contributions_skipped.values()))
        assert np.linalg.norm(raw.samples - exact) <= raw.report.predicted_error * np.linalg.norm(exact)
    assert 0 < skipped[0] <= 1.2 * skipped[1] and abs(pairs[0] - pairs[1]) <= 0.05 * pairs[1]


@pytest.mark.filterwarnings("ignore:mesh too fine")
def test_blocks_of_beams_share_one_sum_of_what_is_left_out(monkeypatch):
    """120 random facets: about 10 beams fit into the sum of bounds, twice as many where each block has its own."""
    rng = np.random.default_rng(0)
    triangles = rng.uniform(-1.5, 1.5, (120, 1, 3)) + rng.uniform(-0.5, 0.5, (120, 3, 3))
    scene = sarcl.Scene.facets(triangles, two_sided=True, material="concrete")
    wave = sarcl.Waveform.chirp(center=1.1e9, bandwidth=50e6, duration=1e-6)
    options = {"reference": (0, 0, 0), "range_window": (-20, 20), "tolerance": 3e-1, "check": False}
    limit(monkeypatch, most_pairs=30)
    raw = sarcl.echo(scene, wave, LOOK, bounces=2, **options)
    assert 0 < raw.report.contributions_skipped["weak reflections"] < 18

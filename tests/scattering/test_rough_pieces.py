"""Pieces of rough facets: cut, placed and given their random numbers on a device."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from helpers.cases import REPEATED, planned_within
from scipy.spatial.transform import Rotation

import sarcl
from sarcl.reference import facet_pieces
from sarcl.scattering import facet_kinds, rough_pieces
from sarcl.scattering.random_surface import ROUND, cell_edge, pieces_of
from sarcl.scattering.rough_pieces import RoughFacets, RoughPieces
from sarcl.scene import triangles as geometry

SLIGHTLY = sarcl.Material(diagram="cos", height=4e-3)
COS, SHARP = sarcl.Material(diagram="cos"), sarcl.Material(eps_r=4.0, conductivity=1e-3, diagram="exp", width=0.5)
CHIRP = sarcl.Waveform.chirp(center=9.6e9, bandwidth=150e6, duration=1e-6)
TURNED = Rotation.from_rotvec([0.3, 1.1, -0.7]).as_matrix()
RANDOM = np.random.default_rng(0)
TRIANGLES = {
    "one that is not cut": np.eye(3)[None] * 0.1,
    "one": np.eye(3)[None] * 3,
    "equilateral": np.array([[[0.0, 0, 0], [4, 0, 0], [2, 2 * np.sqrt(3), 0]]]),
    "needles": RANDOM.uniform(-3, 3, (7, 3, 3)) * [1, 1e-3, 1e-6],
    "many": RANDOM.uniform(-1, 1, (33, 3, 3)) + RANDOM.uniform(-9, 9, (33, 1, 3)),
    # large ones, of whose parts some have two edges alike but for rounding
    "a triangle of nine by three": np.array([[[0.0, 0, 0], [9, 0, 0], [9, 3, 0]]]) @ TURNED.T,
    "a large one beside small ones": np.concatenate([[[[0, 0, 0], [30, 0, 0], [0, 40, 5]]], RANDOM.random((5, 3, 3))]),
}


def scene(triangles, **options):
    return sarcl.Scene.facets(triangles, **{"material": COS, **options})


def terrain(n=12, **options):
    axis = np.linspace(-9, 9, n + 1)
    x, y = np.meshgrid(axis, axis)
    return sarcl.Scene.from_heights(axis, axis, np.sin(x / 3) * np.cos(y / 4), **{"material": COS, **options})


def cut(device, one, cell, seed, *most):
    return RoughPieces.cut(device, one, cell, seed, RoughPieces.suited(device, one), *most)


def track(n=8):
    return sarcl.Trajectory.circle(radius=8e3, height=6e3, arc=0.001, n_pulses=n)


def in_order(triangles):
    rows = np.ascontiguousarray(triangles).reshape(len(triangles), -1)
    return rows[np.lexsort(rows.T)]


@pytest.mark.parametrize("name", TRIANGLES)
def test_the_pieces_are_those_of_the_reference_to_the_last_bit(double, name):
    pieces = cut(double, scene(TRIANGLES[name]), 0.2, 0)
    corners, row = pieces.corners()
    wanted, of = facet_pieces.pieces(pieces.facets, pieces.lengths, ROUND * 0.2)
    assert np.array_equal(corners, wanted) and np.array_equal(row, of)
    assert np.array_equal(np.bincount(of, minlength=len(pieces.facets)), pieces.counts) and len(pieces) == len(wanted)


@pytest.mark.parametrize("name", TRIANGLES)
def test_pieces_cover_their_facets_and_are_those_that_the_host_cuts(double, name):
    triangles = TRIANGLES[name]
    pieces = cut(double, scene(triangles), 0.2, 0)
    corners, row = pieces.corners()
    assert geometry.edges(corners).max() <= ROUND * 0.2
    given = np.bincount(pieces.of[row], geometry.areas(corners), len(triangles))
    assert np.allclose(given, geometry.areas(triangles), rtol=1e-9)
    assert np.array_equal(in_order(corners), in_order(geometry.cut(triangles, ROUND * 0.2, 10**6)[0]))


def test_facets_that_share_an_edge_are_cut_at_the_same_points_of_it(double):
    a, b, c, d = np.array([[0.0, 0, 0], [7, 1, 2], [3, 5, 0], [2, -6, 1]])
    sides = []
    for side in (np.array([[a, b, c]]), np.array([[b, a, d]])):
        corners = cut(double, scene(side), 0.5, 0).corners()[0].reshape(-1, 3)
        away = np.linalg.norm(np.cross(corners - a, b - a), axis=1) / np.linalg.norm(b - a)
        sides.append(np.unique(corners[away < 1e-9], axis=0))
    assert np.array_equal(*sides) and len(sides[0]) > 7 / 0.5


@pytest.mark.costly
def test_a_facet_of_a_million_pieces_is_cut_in_parts(double):
    large = np.array([[[0.0, 0, 0], [400, 0, 0], [0, 300, 9]]])
    pieces = cut(double, scene(large), 0.4, 0)
    assert len(pieces) == len(geometry.cut(large, ROUND * 0.4, 10**7)[0]) > 9e5
    assert pieces.counts.max() <= 4 * rough_pieces.COARSE**2


@pytest.mark.parametrize("width", [1e4, 1e-6])
def test_too_many_pieces_are_refused_with_the_words_of_the_host(double, width):
    long = scene(np.array([[[0.0, 0, 0], [1e4, 0, 0], [0, width, 0]]]))
    on_host = lambda: geometry.cut(long.triangles, ROUND * 0.1, 5000)  # noqa: E731
    texts = []
    for work in (lambda: cut(double, long, 0.1, 0, 5000), on_host):
        with pytest.raises(MemoryError) as refused:
            work()
        texts.append(str(refused.value))
    assert texts[0] == texts[1]


@pytest.mark.parametrize("roughness", [0.0, 0.02])
def test_numbers_of_pieces_are_those_that_the_host_writes(double, roughness):
    index = np.arange(144).reshape(12, 12) % 2
    one = terrain(material=index, materials=[COS, SHARP], roughness=roughness)
    pieces = cut(double, one, cell_edge(CHIRP), 5)
    facets, nodes = RoughFacets(pieces), np.array([9.55e9, 9.65e9])
    n, stride = len(pieces), -(-len(pieces) // 256) * 256
    centers, planes = pieces.placed(*facets.tiling_numbers(nodes, False, True), stride)
    centers = double.download(centers, np.empty((3, stride)))
    wanted = facets._host.planes(np.r_[np.arange(n), np.repeat(n - 1, stride - n)], nodes, False, True)
    planes = double.download(planes, np.empty(wanted.shape, np.float32))
    corners = pieces.corners()[0]
    wanted_centers = facet_pieces.centers(corners, np.full(n, roughness), 5)
    assert np.abs(centers[:, :n].T - wanted_centers).max() < 1e-12 * roughness + 1e-14
    assert (centers[:, n:] == centers[:, n - 1 : n]).all()
    # sines of a polynomial, and logarithms of float32: errors 2e-6 beside the largest numbers
    assert np.abs(planes - wanted).max() < 2e-6
    random = facet_pieces.random_numbers(corners, 5)
    assert np.sqrt(np.mean(np.abs(planes[11, :n] + 1j * planes[12, :n] - random) ** 2)) < 2e-7
    exact = [*range(6, 11), *range(13, len(wanted))]
    assert np.array_equal(planes[exact], wanted[exact]) and not planes[:6, n:].any()


def test_samples_represent_all_pieces(double):
    steps = np.concatenate([TRIANGLES["many"], 8 * TRIANGLES["many"][:3]])
    pieces = cut(double, scene(steps), 0.2, 0)
    size = geometry.areas(steps).sum()
    numbers, areas = [], []
    for seed in range(20):
        some, represents = RoughFacets(pieces).drawn(200, np.random.default_rng(seed))
        numbers.append(represents.sum())
        areas.append(represents @ geometry.areas(some.triangles))
    # a mean over 4000 draws, of weights that differ by a factor of two at most
    assert np.mean(numbers) == pytest.approx(len(pieces), rel=0.03)
    assert np.mean(areas) == pytest.approx(size, rel=0.03)
    cells, each = pieces.sampled_cells(1000)
    assert len(cells.triangles) == 1000 and each == pytest.approx(len(pieces) / 1000)


SCENES = {
    "terrain": (terrain, False),
    "random heights": (lambda: terrain(roughness=0.02), False),
    "two-sided sheets": (lambda: scene(terrain().triangles, two_sided=True, reflectivity=0.3), False),
    "terrain that hides nothing": (terrain, True),
    "a box on terrain": (lambda: terrain() + sarcl.shapes.box((4, 4, 3), material=COS).moved((0, 0, 2.5)), True),
    "a smooth box on terrain": (lambda: terrain() + sarcl.shapes.box((4, 4, 3)).moved((0, 0, 2.5)), True),
    "a slab on terrain, in shadow": (
        lambda: terrain(roughness=0.02) + sarcl.shapes.box((4, 4, 3), material=COS).moved((0, 0, 2.5))
        + sarcl.shapes.plate((9, 9), material=SLIGHTLY).moved((2, 0, 2)), True,
    ),
    "random heights in shadow": (
        lambda: terrain(roughness=0.02) + sarcl.shapes.box((4, 4, 3), material=COS).moved((0, 0, 2.5)), True,
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", [
    "terrain", "two-sided sheets", pytest.param("a slab on terrain, in shadow", marks=pytest.mark.slow), *(
    pytest.param(name, marks=REPEATED) for name in ("random heights", "terrain that hides nothing", "a box on terrain",
                                                    "a smooth box on terrain")
)])  # fmt: skip
def test_echoes_are_those_of_pieces_cut_on_the_host(double, monkeypatch, name):
    one, shadows = SCENES[name][0](), SCENES[name][1]
    ask = {"tolerance": 2e-2 if shadows else 1e-4, "seed": 3, "device": double, "shadows": shadows, "check": True}
    if "slab" in name:  # its cells are cut further for their coherent part
        ask["max_edge"] = 0.3
    plan = planned_within({"few_looks": 0}, sarcl.echo, one, CHIRP, track(), **ask)  # shadows are shares
    here = plan.run()
    nothing = lambda device, scene: np.zeros(len(scene.triangles), bool)  # noqa: E731
    monkeypatch.setattr(RoughPieces, "suited", staticmethod(nothing))
    there = plan.run()
    assert here.report.measured_error <= here.report.predicted_error
    assert np.linalg.norm(here.samples - there.samples) <= ask["tolerance"] / 10 * np.linalg.norm(there.samples)
    assert here.report.contributions_done == there.report.contributions_done
    assert here.report.contributions_skipped == there.report.contributions_skipped
    assert (here.report.contributions_skipped["shadowed"] > 0) == ("box" in name or "shadow" in name)
    assert (here.report.plan.get("partly lit facets", 0) > 0) == ("smooth" in name or "slab" in name)


@pytest.mark.parametrize("is_picked", [False, True])
def test_blocks_hold_each_piece_once(double, is_picked):
    pieces = cut(double, scene(TRIANGLES["many"]), 0.2, 0)
    some = np.flatnonzero(np.arange(len(pieces)) % 3 > 0) if is_picked else np.arange(len(pieces))
    pieces = pieces.picked(some)
    blocks = list(replace(pieces, block=300).blocks())
    assert len(blocks) > 3
    assert np.array_equal(np.concatenate([np.arange(len(pieces))[here] for here, _ in blocks]), np.arange(len(pieces)))
    whole, row = pieces.corners()
    for here, block in blocks:
        corners, of = block.corners()
        assert np.array_equal(corners, whole[here]) and np.array_equal(block.of[of], pieces.of[row[here]])


@pytest.mark.parametrize("name", ["random heights", "a slab on terrain, in shadow"])
def test_pieces_made_anew_for_each_block_of_pulses_give_the_same_bits(double, monkeypatch, name):
    one, shadows = SCENES[name][0](), SCENES[name][1]
    ask = {"tolerance": 2e-2, "seed": 3, "device": double, "shadows": shadows}
    plan, anew = (
        planned_within({"few_looks": 0} | more, sarcl.echo, one, CHIRP, track(), **ask)
        for more in ({}, {"kept_pieces": 0.0})
    )
    whole, whole_cut = plan.run().samples, RoughPieces.cut
    monkeypatch.setattr(RoughPieces, "cut", lambda *given: replace(whole_cut(*given), block=500))
    stay = plan.run().samples
    assert np.array_equal(anew.run().samples, stay)
    assert np.linalg.norm(stay - whole) <= ask["tolerance"] / 4 * np.linalg.norm(whole)  # each block has its plan


def test_pieces_on_a_device_are_not_limited_by_the_memory_for_facets(double):
    ask = {"tolerance": 1e-2, "device": double, "shadows": False}
    one = terrain(150)  # of as many facets and ten times as many pieces as 256 MiB hold
    wide = sarcl.Waveform.chirp(center=9.6e9, bandwidth=9e9, duration=1e-6)
    assert sarcl.plan(sarcl.echo, one, wide, track(1), max_bytes=1e6, **ask).plan["facets"] > 10 * 2**28 / 512
    with pytest.raises(sarcl.ToleranceUnreachable, match="512 bytes per facet"):
        sarcl.plan(sarcl.echo, one, wide, track(1), max_bytes=1e6, **{**ask, "device": double.without_fp64()})


def test_more_pieces_in_shadow_than_the_host_holds_are_refused(double):
    plan = planned_within({"few_looks": 0, "host": 1e4}, sarcl.echo, SCENES["a box on terrain"][0](), CHIRP, track(),
                          tolerance=2e-2, device=double)  # fmt: skip
    with pytest.raises(MemoryError, match="shadows may fall on"):
        plan.run()


def test_facets_that_face_away_or_send_nothing_back_are_not_cut(double):
    up = terrain().triangles
    away = np.concatenate([up, up[:100, ::-1], up[:50]])
    one = scene(away, two_sided=False, reflectivity=np.r_[np.ones(len(up) + 100), np.zeros(50)])
    report = sarcl.echo(one, CHIRP, track(), shadows=False, device=double).report
    each = len(pieces_of(one, cell_edge(CHIRP), np.inf, 0))
    assert report.plan["facets"] == each
    left = report.contributions_skipped
    assert left["facing away"] == 8 * len(pieces_of(scene(up[:100]), cell_edge(CHIRP), np.inf, 0))
    assert left["zero reflectivity"] == 8 * len(pieces_of(scene(up[:50]), cell_edge(CHIRP), np.inf, 0))
    assert report.contributions_done + sum(left.values()) == 8 * each


def test_mirrors_and_devices_without_float64_leave_it_to_the_host(double):
    assert RoughPieces.suited(double, terrain()).all()
    assert not RoughPieces.suited(double.without_fp64(), terrain()).any()
    mixed = terrain() + sarcl.shapes.plate((1, 1)) + sarcl.shapes.plate((1, 1), material=SLIGHTLY)
    assert np.array_equal(RoughPieces.suited(double, mixed), mixed.material == 0)
    assert not RoughPieces.suited(double, replace(terrain(), triangles=terrain().triangles + 2e9, heights=None)).any()


def test_pieces_of_both_ways_are_all_pieces_of_a_scene(double):
    mixed = terrain(roughness=0.02) + sarcl.shapes.plate((9, 9), material=SLIGHTLY).moved((0, 0, 2))
    is_rough = RoughPieces.suited(double, mixed)
    rough, host = cut(double, mixed, 0.4, 3), pieces_of(mixed, 0.4, 0.2, 3, ~is_rough)
    whole = pieces_of(mixed, 0.4, 0.2, 3)
    both = in_order(np.concatenate([rough.corners()[0], host.scene.triangles]))
    assert np.array_equal(both, in_order(whole.scene.triangles)) and len(both) == len(whole)
    on_host = ~is_rough[whole.of]
    for name in ("of", "height", "random", "incoherent"):
        assert np.array_equal(getattr(host, name), getattr(whole, name)[on_host])


@pytest.mark.parametrize("tolerance", [1e-1, 1e-2])
def test_smooth_facets_beside_rough_ground_are_cut_as_they_are_alone(tolerance):
    """Pieces of the ground, which a device cuts by a plan of their own, say nothing of how the others are cut best."""
    axis = np.linspace(-20, 20, 21)
    rough = sarcl.Material(eps_r=4.0, conductivity=1e-3, diagram="cos")
    ground = sarcl.Scene.from_heights(axis, axis, np.zeros((21, 21)), material=rough)
    box = sarcl.shapes.box((4.0, 2.0, 1.5), material="metal")
    chirp = sarcl.Waveform.chirp(center=9.6e9, bandwidth=300e6, duration=1e-6)
    track = sarcl.Trajectory.line(start=(-7e3, -300, 5e3), velocity=(0, 100, 0), prf=4.0, n_pulses=24)
    options = {"tolerance": tolerance, "shadows": False, "check": False}
    both, alone = (sarcl.echo(scene, chirp, track, **options).report.plan for scene in (ground + box, box))
    for name in ("facet edges, m", "frequencies per facet"):
        assert both[name] == alone[name]


@pytest.mark.parametrize(("n_levels", "most"), [(1, 3), (4, 12), (2000, 1500)])
def test_an_example_stands_for_each_facet_of_its_kind(n_levels, most):
    random = np.random.default_rng(2)
    level, index = random.random(n_levels)[random.integers(0, n_levels, 2000)], random.integers(0, 3, 2000)
    materials = COS, SHARP, SLIGHTLY
    alike = replace(scene(random.random((2000, 3, 3))), reflectivity=level, materials=materials, material=index)
    some = np.sort(random.choice(2000, 1500, replace=False))
    example, kind = facet_kinds.examples(alike, some)
    chosen = some[example][kind]
    assert (alike.reflectivity[chosen] == level[some]).all() and (alike.material[chosen] == index[some]).all()
    assert len(example) == most and set(kind.tolist()) == set(range(len(example)))

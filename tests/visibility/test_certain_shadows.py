"""Shadows that miss a facet, or cover it, from every antenna of a box: against polygons, and the same by NumPy."""

from __future__ import annotations

import numpy as np
import pytest

from sarcl.opencl.choose_device import with_float64
from sarcl.reference.certain_shadows import certain_shadow
from sarcl.reference.lit_part import lit_part
from sarcl.scene.triangles import cut, of_grid
from sarcl.visibility._certain_shadows import COVERED, MISSED, UNDECIDED, box_about, certain_shadows
from sarcl.visibility._clipping import SLACK, Clipper, Receivers
from sarcl.visibility.lit_parts import FacetPieces, LitParts

ON_PLANE = 1e-6  # m
NO_WAVES = np.zeros(0)


def pairs_of(seed):
    """Facets and occluders, m (n, 3, 3), which occlude them or not, and antennas, m (5, 1 or 2, 3)."""
    random = np.random.default_rng(seed)
    n = 60
    facets = random.uniform(-0.3, 0.3, (n, 3, 3)) * [1, 1, 0.2]
    size = random.choice([0.2, 1.0, 4.0], (n, 1, 1))
    occluders = size * random.uniform(-1, 1, (n, 3, 3)) * [1, 1, 0.2] + random.uniform(-1, 1, (n, 1, 3)) + [0, 0, 0.7]
    ends = 1 + seed % 2
    middle = random.uniform(-1, 1, (1, ends, 3)) * [3, 3, 0] + [0, 0, random.choice([2.0, 8.0, 300.0])]
    spread = random.choice([1e-3, 0.02, 0.2])
    return facets, occluders, middle + spread * middle[..., 2:] * random.uniform(-1, 1, (5, ends, 3)) * [1, 1, 0.1]


def states(device, facets, occluders, antennas):
    """State of each facet and the occluder of the same number (n,)."""
    chosen, n = with_float64(device), np.arange(len(facets))
    packed = Receivers(n, facets, *np.ones((2, len(n)), bool)).packed(n, np.zeros(3), ON_PLANE)
    index, solid = chosen.upload(n.astype(np.int32)), chosen.upload(occluders.reshape(-1, 9))
    return certain_shadows(chosen, (chosen.upload(packed), index, index, solid), len(n), antennas)


@pytest.mark.parametrize("seed", range(12))
def test_what_is_certain_is_what_polygons_say_from_every_antenna(device, seed):
    facets, occluders, antennas = pairs_of(seed)
    random, boxes = np.random.default_rng(seed), [box_about(antennas[:, end]) for end in range(antennas.shape[1])]
    found = states(device, facets, occluders, antennas)
    for facet, occluder, state in zip(facets, occluders, found, strict=True):
        for parts in random.dirichlet(np.ones(8), 3):  # anywhere in the boxes
            inside = [parts[: len(box)] / parts[: len(box)].sum() @ box for box in boxes]
            share = lit_part(facet, occluder[None], inside, NO_WAVES, ON_PLANE)[0]
            assert state != MISSED or share == pytest.approx(1, abs=1e-9)
            assert state != COVERED or share == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize("seed", range(12))
def test_the_kernel_decides_as_the_reference(device, seed):
    facets, occluders, antennas = pairs_of(seed)
    boxes = [box_about(antennas[:, end]) for end in range(antennas.shape[1])]
    lengths = np.linalg.norm(np.roll(facets, -1, axis=1) - facets, axis=2).max(axis=1)
    wanted = [
        certain_shadow(facet, occluder, boxes, ON_PLANE, SLACK * length)
        for facet, occluder, length in zip(facets, occluders, lengths, strict=True)
    ]
    np.testing.assert_array_equal(states(device, facets, occluders, antennas), wanted)


def test_a_wall_that_stands_below_the_facets_plane_covers_what_lies_behind_it(device):
    facet = np.array([[0.5, 0.0, 0.03], [0.6, 0.0, 0.03], [0.5, 0.1, 0.03]])
    walls = np.array([
        [[0, -9, -0.5], [0, 9, -0.5], [0, 0.0, 9.0]],  # through the plane
        [[0, -9, 0.03], [0, 9, 0.03], [0, 0.0, 9.0]],  # on it
        [[-9, -9, 0.03], [9, -9, 0.03], [0, 9, 0.03]],  # in it, larger than the facet
        [[0, -9, -9.0], [0, 9, -9.0], [0, 0, 0.01]],  # below it
    ])  # fmt: skip
    antennas = np.array([[-80, -1, 50], [-80, 0, 50], [-80, 1, 50.0]])[:, None]
    found = states(device, np.broadcast_to(facet, (4, 3, 3)), walls, antennas)
    assert found[:2].tolist() == [COVERED, COVERED] and (found[2:] != COVERED).all()


def test_of_random_pairs_all_three_are_found(device):
    counts = sum(np.bincount(states(device, *pairs_of(seed)), minlength=3) for seed in range(12))
    assert (counts > 20).all(), counts


def test_neighbours_on_a_hill_do_not_shade_one_another(device):
    """They touch: it is the distance beside an edge that counts as the edge which decides."""
    axis = np.linspace(-1, 1, 9)
    corners = np.stack([*np.meshgrid(axis, axis), -0.2 * np.add.outer(axis**2, axis**2)], axis=-1)
    facets = of_grid(corners)
    one, two = (side.ravel() for side in np.indices((len(facets), len(facets))))
    touch = (np.abs(facets[one][:, :, None] - facets[two][:, None]).max(axis=-1) == 0).any(axis=(1, 2)) & (one != two)
    track = np.stack([np.linspace(-3, 3, 8), np.full(8, -40.0), np.full(8, 60.0)], axis=1)[:, None]
    found = states(device, facets[one[touch]], facets[two[touch]], track)
    assert (found == MISSED).all()


def test_a_box_holds_what_it_is_about():
    random = np.random.default_rng(0)
    line = np.array([1e4, 2e3, 5e3]) + np.multiply.outer(np.linspace(-50, 50, 9), [0.6, 0.0, 0.8])
    arc = 1e4 * np.stack([np.cos(t := np.linspace(0, 0.05, 9)), np.sin(t), np.full(9, 0.5)], axis=1)
    for positions, corners in ((line[:1], 1), (line, 2), (arc, 4), (arc + random.normal(0, 0.1, arc.shape), 8)):
        box = box_about(positions)
        assert len(box) == corners
        for direction in random.normal(size=(200, 3)):
            assert (positions @ direction).max() <= (box @ direction).max() + 1e-8
        wider = box_about(positions, 2.0)
        for direction in random.normal(size=(200, 3)):
            reach = (positions @ direction).max() + 2 * np.linalg.norm(direction)
            assert reach <= (wider @ direction).max() + 1e-8


def test_pieces_in_the_middle_of_a_shadow_and_beside_it_are_decided_for_all_pulses_at_once(device, monkeypatch):
    """Of a plate under another, only the pieces at the shadow's edge are clipped pulse by pulse."""
    square = np.array([[[-1, -1, 0], [1, -1, 0]], [[-1, 1, 0], [1, 1, 0]]], float)
    pieces, of = cut(of_grid(2 * square), 0.1, 10**6)
    above = of_grid(square + np.array([0, 0, 1.0]))
    track = np.stack([np.linspace(-20, 20, 40), np.full(40, -4e3), np.full(40, 8e3)], axis=1)
    every = np.ones(len(pieces), bool)
    facets = FacetPieces(pieces, every, every, of_grid(2 * square), of)
    parts = LitParts(device, facets, above, [track], max_bytes=1e8)
    clipped, computed = [], Clipper._computed

    def count(clipper, receivers, which, begins, occluder, *rest):
        clipped.append(int((np.diff(begins) > 0).sum()))
        return computed(clipper, receivers, which, begins, occluder, *rest)

    monkeypatch.setattr(Clipper, "_computed", count)
    share, _ = parts.at(0, [track], np.array([200.0]))
    assert parts.dark.sum() > 0.15 * len(pieces)  # 1/4 of the area is in shadow
    assert 0 < max(clipped) <= parts.partly.sum() < 0.1 * len(pieces)
    assert share.min() < 0.5 < share.max()


def test_nothing_is_certain_of_an_occluder_that_antennas_see_from_both_sides(device):
    facet = np.array([[[-0.1, -0.1, 0], [0.1, -0.1, 0], [0, 0.1, 0]]])
    upright = np.array([[[0.0, -1, 0.5], [0.0, 1, 0.5], [0.0, 0, 3.0]]])
    antennas = np.array([[[-3.0, 0, 10]], [[3.0, 0, 10]]])
    assert states(device, facet, upright, antennas)[0] == UNDECIDED


def test_a_box_about_many_positions_takes_memory_for_these_alone():
    import tracemalloc

    positions = np.random.default_rng(0).normal(size=(30_000, 3))
    tracemalloc.start()
    box_about(positions)
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert most < 8 * positions.nbytes

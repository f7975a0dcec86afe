"""Grid lines inside closed meshes: closed forms, exact hits of edges and corners, several bodies, refusals."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.devices import opened, variants

import sarcl
from sarcl import shapes
from sarcl.fullwave.bodies.cut_cells import conductor
from sarcl.fullwave.bodies.mesh_lines import mesh_lines
from sarcl.fullwave.fields import BLOCK, Fields
from sarcl.fullwave.lattice import Lattice, lattice_around
from sarcl.scene.triangles import rotation

CELL = 0.1  # m
GRID = Lattice(CELL, (30, 30, 32), np.zeros(3))
ROUNDING = 1e-5  # cells: corners are rounded to 2^-20 cells, and one unit of height can hide ten of length


def grid_of(triangles, cell, margin=3):
    corners = triangles.reshape(-1, 3)
    return lattice_around(corners.min(axis=0), corners.max(axis=0), cell, margin)


def box(low, high):
    """Facets of a box between two nodes of GRID, or between any places in cells."""
    low, high = CELL * np.array(low, float), CELL * np.array(high, float)
    return shapes.box(high - low, position=[*(low + high)[:2] / 2, low[2]]).triangles


def held(part):
    """{(line, line): [(start, end), ...]} of intervals, rounded."""
    out = {}
    for line, start, end in zip(part.lines, part.start, part.end, strict=True):
        out.setdefault(tuple(line), []).append((round(float(start), 4), round(float(end), 4)))
    return out


def same(one, other):
    return all(held(a) == held(b) for a, b in zip(one.intervals, other.intervals, strict=True))


def volume(triangles):
    """m^3, by the theorem of divergence."""
    return float(np.linalg.det(triangles).sum() / 6)


def lists(lattice, triangles):
    target = conductor(lattice, mesh_lines(lattice, triangles).intervals)
    return set(target.edges), set(target.faces)


def test_the_volume_along_each_axis_approaches_that_of_the_mesh():
    ball = shapes.sphere(1.0, facets=500, position=(0.013, -0.021, 0.034), rotation=(0.3, 0.5, -0.2)).triangles
    off = [
        np.abs(mesh_lines(grid_of(ball, cell), ball).volume / volume(ball) - 1).max() for cell in (0.2, 0.1, 0.05, 0.02)
    ]
    assert off[0] < 0.05 and off[-1] < 3e-4
    assert off[2] < off[0] / 4 and off[3] < off[1] / 4


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_gaps_narrower_than_a_cell_are_found_with_their_width(axis):
    """0.6 cells between 10.2 and 10.8, and 0.6 cells about a node; a surface on a node belongs to its body."""

    def gap(left, right):
        low, high = np.full(3, 6.0), np.full(3, 16.0)
        first = box(low, np.where(np.arange(3) == axis, left, high))
        second = box(np.where(np.arange(3) == axis, right, low), high)
        return mesh_lines(GRID, np.concatenate([first, second])).gap

    assert np.isclose(gap(10.2, 10.8), 0.6 * CELL, rtol=1e-5)
    assert np.isclose(gap(10.0, 11.0), CELL, rtol=1e-5)
    assert np.isclose(gap(9.7, 10.3), 0.6 * CELL, rtol=1e-5)  # a node lies in it
    assert gap(9.7, 10.8) is None and gap(10.1, 11.8) is None  # wider than a cell
    assert gap(10.4, 10.4) is None and gap(10.4, 10.4005) is None  # they touch


def test_a_gap_askew_is_found_with_its_width_across():
    turn = rotation(np.array([0.3, 0.2, 0.5]))
    halves = [shapes.box((0.5, 1, 1), position=(x, 0, -0.5)).triangles @ turn.T + 1.5 for x in (-0.27, 0.27)]
    assert np.isclose(mesh_lines(GRID, np.concatenate(halves)).gap, 0.04, rtol=1e-3)


def test_a_sphere_has_the_intervals_of_the_formula_within_the_depth_of_its_facets():
    radius, centre = 1.0, np.array([1.43, 1.52, 1.61])
    ball = shapes.sphere(radius, facets=5000, position=centre, rotation=(0.3, 0.5, -0.2)).triangles
    normal = np.cross(ball[:, 1] - ball[:, 0], ball[:, 2] - ball[:, 0])
    depth = radius - (((ball[:, 0] - centre) * normal).sum(axis=1) / np.linalg.norm(normal, axis=1)).min()
    assert 0 < depth < 0.003
    for axis, part in enumerate(mesh_lines(GRID, ball).intervals):
        b, c = (axis + 1) % 3, (axis + 2) % 3
        off = np.hypot(*(CELL * part.lines - centre[[b, c]]).T)
        for end in (part.start, part.end):
            r = np.hypot(off, CELL * end - centre[axis])
            assert (r <= radius + CELL * ROUNDING).all() and (r >= radius - depth - CELL * ROUNDING).all()
        every = np.stack(np.meshgrid(*(np.arange(GRID.shape[n]) for n in (b, c)), indexing="ij"), -1).reshape(-1, 2)
        reach = np.hypot(*(CELL * every - centre[[b, c]]).T)
        assert {tuple(n) for n in every[reach < radius - depth]} <= set(held(part))
        assert all(len(spans) == 1 for spans in held(part).values())


def test_a_box_whose_sides_lie_on_grid_lines_has_its_exact_volume_and_cuts_no_cell():
    lines = mesh_lines(GRID, box((10, 8, 9), (20, 21, 17)))
    assert np.allclose(lines.volume, 1.0 * 1.3 * 0.8, rtol=1e-12)
    for part, (first, last) in zip(lines.intervals, ((10, 20), (8, 21), (9, 17)), strict=True):
        assert (part.start == first).all() and (part.end == last).all()
    assert [len(part.lines) for part in lines.intervals] == [14 * 9, 9 * 11, 11 * 14]  # its surface is part of it
    target = conductor(GRID, lines.intervals)
    assert len(target.faces) == 0
    component, *node = np.unravel_index(target.edges, (3, *GRID.shape))
    for axis, (first, last) in enumerate(((10, 20), (8, 21), (9, 17))):
        assert (node[axis] >= first).all()
        assert (node[axis] + (component == axis) <= last).all()


def test_a_quarter_turn_turns_the_intervals():
    turn = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    grid = Lattice(CELL, (32, 32, 32), np.full(3, -1.6))  # node (16, 16, 16) is the origin
    for body in (
        shapes.box((1.0, 0.6, 0.8)),
        shapes.cone(0.7, 1.2, sections=7),
        shapes.sphere(1.1, facets=300, position=(0.11, 0.05, -0.17), rotation=(0.2, 0.4, 0.1)),
    ):
        plain, turned = (mesh_lines(grid, t) for t in (body.triangles, body.triangles @ turn.T))
        # (x, y, z) -> (-y, x, z): what lay along x lies along y, on lines (z, x) = (z, -y)
        wanted = {}
        for (y, z), spans in held(plain.intervals[0]).items():
            wanted[z, 32 - y] = spans
        got = held(turned.intervals[1])
        assert set(got) == set(wanted)
        assert max(np.abs(np.subtract(got[line], wanted[line])).max() for line in got) < 2e-4
        assert np.allclose(turned.volume, plain.volume[[1, 0, 2]], rtol=1e-5)


def test_a_box_turned_by_rounded_matrices_is_the_same_box():
    base = mesh_lines(GRID, box((9, 9, 9), (20, 20, 20)))
    centre = CELL * np.full(3, 14.5)
    for angle in (90, 180, 270):
        matrix = sarcl.scene.triangles.rotation(np.array([0, 0, np.radians(angle)]))
        turned = mesh_lines(GRID, (box((9, 9, 9), (20, 20, 20)) - centre) @ matrix.T + centre)
        assert same(turned, base)


def test_every_line_leaves_as_often_as_it_enters_where_corners_lie_on_nodes():
    """Corners on nodes and half nodes: lines meet corners, edges and facets along their whole length. A line that does
    not leave the body would lie in it up to another body's line: the volume would be far larger."""
    rng = np.random.default_rng(11)
    for body in (shapes.sphere(1.2, facets=300), shapes.cone(1.1, 1.0, sections=9), shapes.cylinder(0.9, 1.1)):
        turned = body.triangles @ sarcl.scene.triangles.rotation(rng.normal(size=3)).T + 1.5
        for fineness in (1, 2):
            corners = np.rint(turned / CELL * fineness) / fineness * CELL
            found, volume = mesh_lines(GRID, corners), np.linalg.det(corners - 1.5).sum() / 6
            low, high = corners.min(axis=(0, 1)) / CELL - 1e-3, corners.max(axis=(0, 1)) / CELL + 1e-3
            assert found.volume == pytest.approx(np.full(3, volume), rel=0.08)
            for axis, intervals in enumerate(found.intervals):
                ends = np.concatenate([np.ravel(spans) for spans in held(intervals).values()])
                assert len(ends) > 30 and low[axis] <= ends.min() and ends.max() <= high[axis]


@pytest.mark.parametrize("aside", [(0, 0, 0), (1e-9, -1e-9, 1e-9), (0.37, -0.21, 0.43)])
def test_the_tip_of_a_cone_is_met_exactly_and_missed(aside):
    """Axis on a grid line, tip on a node; then beside them by less than rounding, and by parts of a cell."""
    cone = shapes.cone(0.8, 1.5).triangles + CELL * (np.array([15, 15, 5]) + aside)
    lines = mesh_lines(GRID, cone)
    ring = np.arctan2(0, 1) + 2 * np.pi / 72
    assert np.isclose(volume(cone), 36 * np.sin(ring) * 0.8**2 * 1.5 / 3)
    assert np.allclose(lines.volume, volume(cone), rtol=0.03)
    along = held(lines.intervals[2])
    start, end = along[15, 15][0]
    off = np.hypot(aside[0], aside[1])
    assert abs(start - 5 - aside[2]) < 2e-4
    assert 20 + aside[2] - off * 1.5 / 0.8 / np.cos(np.pi / 72) - 2e-4 <= end <= 20 + aside[2] + 2e-4


def test_bodies_that_overlap_or_touch_are_their_union():
    left, right = box((8, 8, 8), (15, 20, 20)), box((15, 8, 8), (22, 20, 20))
    outer = box((8, 8, 8), (22, 20, 20))
    whole = mesh_lines(GRID, outer)
    assert same(mesh_lines(GRID, np.concatenate([left, right])), whole)  # a wall in common
    assert same(mesh_lines(GRID, np.concatenate([left, box((12, 8, 8), (22, 20, 20))])), whole)
    assert same(mesh_lines(GRID, np.concatenate([outer, left])), whole)
    # through each other
    crossed = mesh_lines(GRID, np.concatenate([outer, box((12.5, 4.5, 10.5), (17.5, 24.5, 15.5))]))
    assert np.allclose(crossed.volume, CELL**3 * (14 * 12 * 12 + 5 * (20 - 12) * 5), rtol=1e-6)
    # an edge in common: two bodies, with two intervals on lines across both
    apart = mesh_lines(GRID, np.concatenate([box((8, 8, 8), (15, 15, 20)), box((15, 15, 8), (22, 22, 20))]))
    assert np.allclose(apart.volume, 2 * CELL**3 * 7 * 7 * 12, rtol=1e-6)
    # apart
    two = held(mesh_lines(GRID, np.concatenate([box((4, 8, 8), (9, 20, 20)), right])).intervals[0])
    assert two[10, 10] == [(4.0, 9.0), (15.0, 22.0)]


def test_a_surface_wound_inwards_within_a_body_is_a_cavity():
    hollow = np.concatenate([box((5, 5, 5), (22, 22, 22)), box((9.5, 9.5, 9.5), (18.5, 18.5, 18.5))[:, ::-1]])
    lines = mesh_lines(GRID, hollow)
    assert held(lines.intervals[0])[12, 12] == [(5.0, 9.5), (18.5, 22.0)]
    assert np.allclose(lines.volume, CELL**3 * (17**3 - 9**3), rtol=1e-6)


def test_a_trimesh_and_a_scene_have_the_same_lines():
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=2, radius=1.0)
    ball.apply_translation((1.5, 1.45, 1.62))
    assert same(mesh_lines(GRID, ball.triangles), mesh_lines(GRID, sarcl.Scene.from_mesh(ball).triangles))


@pytest.mark.parametrize("param", variants(names=()))
@pytest.mark.parametrize("angle", [0, 0.3])
def test_fields_beside_a_box_are_stable_on_grid_lines_and_askew(param, angle):
    grid = Lattice(CELL, (14, 15, 16), np.zeros(3))
    body = box((4, 4, 5), (9, 10, 11))
    matrix = sarcl.scene.triangles.rotation(np.array([angle, angle / 2, angle]))
    centre = CELL * np.array([6.5, 7, 8])
    target = conductor(grid, mesh_lines(grid, (body - centre) @ matrix.T + centre).intervals)
    assert (len(target.faces) > 0) == (angle > 0)
    e, h = np.random.default_rng(7).uniform(-1, 1, (2, 3, *grid.shape))
    e.flat[target.edges] = 0
    fields = Fields(opened(param), grid, target)
    fields.start(e, h)
    for _ in range(400 // BLOCK):
        fields.advance(BLOCK)
    assert 0.1 < np.abs(fields.download()[0]).max() < 10


def refused(triangles, message, lattice=GRID):
    with pytest.raises(ValueError, match=message):
        mesh_lines(lattice, triangles)


def test_open_meshes_are_refused_with_a_place():
    refused(box((8, 8, 8), (20, 20, 20))[1:], r"open at 3 of 18 edges, one from .* wanted a closed surface")
    refused(shapes.plate((1, 1), position=(1.5, 1.5, 1.5)).triangles, "open at 4 of 5 edges")


def test_pinholes_and_cracks_far_below_a_cell_are_closed():
    body = shapes.sphere(1.0, facets=300, position=(1.5, 1.5, 1.6)).triangles
    pinhole = np.concatenate([body[1:], _around(body[0], 5e-4 * CELL)])
    assert same(mesh_lines(GRID, pinhole), mesh_lines(GRID, body))
    refused(np.concatenate([body[1:], _around(body[0], 5e-2 * CELL)]), "open at 3 of")
    cracked = body.copy()
    cracked[7] += 3e-4 * CELL
    for crack, whole in zip(mesh_lines(GRID, cracked).intervals, mesh_lines(GRID, body).intervals, strict=True):
        assert (crack.lines == whole.lines).all()
        assert np.abs(crack.start - whole.start).max() < 0.05 and np.abs(crack.end - whole.end).max() < 0.05


def _around(facet, size):
    """A facet (3, 3) with a hole of a size, m, in its middle: six facets."""
    middle = facet.mean(axis=0)
    hole = middle + (facet - middle) * size / np.linalg.norm(facet - middle, axis=1).max()
    after = [1, 2, 0]
    return np.concatenate([np.stack([facet, facet[after], hole[after]], 1), np.stack([facet, hole[after], hole], 1)])


def test_winding_that_is_mixed_or_inwards_is_refused():
    body = box((8, 8, 8), (20, 20, 20))
    mixed = body.copy()
    mixed[3] = mixed[3, ::-1]
    refused(mixed, r"opposite winding at 3 of 18 edges.*repair=True")
    refused(body[:, ::-1], r"wound inwards on 169 of 169 grid lines along x.*repair=True")
    ball = shapes.sphere(0.6, facets=500, position=(1.5, 1.5, 1.5)).triangles
    corners, label = np.unique(ball.reshape(-1, 3).round(9), axis=0, return_inverse=True)
    noisy = corners + np.random.default_rng(0).normal(scale=0.2, size=corners.shape)
    refused(noisy[label.reshape(-1, 3)], r"wound inwards on .* wound outwards already, it intersects itself: unite")
    # one of two bodies
    refused(np.concatenate([body, box((2, 2, 2), (6, 6, 6))[:, ::-1]]), r"wound inwards on 25 of 194 grid lines")


def test_a_surface_that_passes_through_itself_is_refused():
    """A bar of square section that bends back through its own beginning: one body, as its facets are joined."""
    path = np.array([[4, 8, 8], [24, 8, 8], [24, 20, 8], [12, 20, 8], [12, 2, 8.0]])
    ways = np.diff(path, axis=0) / np.linalg.norm(np.diff(path, axis=0), axis=1)[:, None]
    side = np.cross(np.concatenate([ways[:1], ways[:-1] + ways[1:], ways[-1:]]), [0, 0, 1.0])
    left, up = 3 * side, np.array([0, 0, 6.0])
    rings = np.stack([path - left, path + left, path + left + up, path - left + up, path - left], axis=1)
    ends = [rings[0, [0, 3, 2, 1]], rings[-1, :4]]
    tube = sarcl.scene.triangles.of_grid(rings)
    lids = np.array([[end[0], end[i], end[i + 1]] for end in ends for i in (1, 2)])
    bar = CELL * np.concatenate([tube, lids])
    outward = bar if volume(bar) > 0 else bar[:, ::-1]
    refused(outward, r"intersect themselves in 1 of 1 bodies, on \d+ of \d+ grid lines along x.*unite the parts")
    assert (
        mesh_lines(GRID, np.concatenate([box((4, 4, 8), (24, 12, 14)), box((8, 2, 8.5), (16, 20, 13))])).volume[0] > 0
    )


@pytest.mark.parametrize("tilt", [0, 0.1, 0.4, 0.8])
def test_a_plate_thinner_than_a_cell_is_refused_with_the_cell_that_resolves_it(tilt):
    """Thickness 0.4 cells: between two planes of nodes where it is not tilted; else nodes are inside here and there."""
    matrix = sarcl.scene.triangles.rotation(np.array([tilt, tilt / 3, 0]))
    plate = shapes.box((1.6, 1.4, 0.04), position=(0, 0, 0.03)).triangles @ matrix.T + 1.5
    message = r"too thin for cells of 0\.1 m: about 0\.04 m thick, .* between the nodes of the grid; give cells of at"
    refused(plate, message + r" most 0\.028 m")
    fine = mesh_lines(grid_of(plate, 0.028), plate)
    assert np.allclose(fine.volume[2], volume(plate), rtol=0.02)


def test_a_surface_without_thickness_is_refused():
    sheet = shapes.plate((1, 1), position=(1.5, 1.5, 1.53)).triangles
    refused(np.concatenate([sheet, sheet[:, ::-1]]), "about 0 m thick, .* nodes of the grid; give them a thickness")


def test_sharp_edges_are_no_thin_parts_however_small_the_cells():
    """A wedge of 15 degrees, and a cone of half angle 8 degrees."""
    wedge = shapes.frustum(0.5, 1e-4, 1.0, sections=4).triangles * [1, 0.37, 1]
    for body in (wedge, shapes.cone(0.21, 1.5).triangles):
        for cell in (0.08, 0.04, 0.02):
            assert np.allclose(mesh_lines(grid_of(body, cell), body).volume[2], volume(body), rtol=0.1)


def wedge_of(angle):
    """A prism over a right triangle with this angle, degrees, at its edge; 1 m long and wide."""
    height = np.tan(np.radians(angle))
    corners = np.array([[x, y, z] for y in (0, 1) for x, z in ((0, 0), (1, 0), (1, height))], float)
    faces = [[0, 1, 2], [3, 5, 4], [0, 3, 4], [0, 4, 1], [1, 4, 5], [1, 5, 2], [2, 5, 3], [2, 3, 0]]
    return corners[faces] if volume(corners[faces]) > 0 else corners[faces][:, ::-1]


@pytest.mark.parametrize("angle", [3, 6, 8, 10, 15, 20])
def test_wedges_are_refused_below_five_degrees_and_run_above_wherever_they_lie(angle):
    """A prism over a right triangle with this angle at its edge; turned, and with flat sides along the grid."""
    wedge = wedge_of(angle)
    rng = np.random.default_rng(angle)
    for turned in [False] * 6 + [True] * 4:
        body = wedge @ rotation(rng.uniform(-1, 1, 3) * turned).T
        grid = grid_of(body, rng.uniform(1 / 50, 1 / 10))
        if angle < 5:
            refused(body, "too thin for cells", grid)
        else:
            mesh_lines(grid, body)


@pytest.mark.parametrize("turn", [(0.3, 0.5, -0.2), (0.1, -0.4, 1.1)])
def test_the_strip_at_the_edge_of_a_wedge_is_a_sheet_where_it_may_be_as_wide(turn):
    """A wedge of 4 degrees is as thick as a cell at 14.3 cells from its edge."""
    body, cell = wedge_of(4) @ rotation(np.array(turn)).T, 0.02
    grid, width = grid_of(body, cell), cell / np.tan(np.radians(4))
    with pytest.raises(ValueError, match="too thin for cells of"):
        mesh_lines(grid, body, 11)
    found = mesh_lines(grid, body, 16)
    assert np.isclose(found.strip_area, width, rtol=0.1)
    along = (grid.origin + cell * found.strips) @ rotation(np.array(turn))  # back to the edge at x = 0
    assert np.abs(along[:, 0].min()) < 1.5 * cell and np.isclose(along[:, 0].max(), width, atol=2 * cell)


def test_sheets_of_strips_are_joined_by_edges_without_holes():
    """Nodes beside a tilted strip: each has a neighbour along the grid, and no line through the strip misses them."""
    from scipy.ndimage import label

    body = wedge_of(4) @ rotation(np.array([0.3, 0.5, -0.2])).T
    found = mesh_lines(grid_of(body, 0.02), body, 16)
    low = found.strips.min(axis=0)
    held = np.zeros(np.ptp(found.strips, axis=0) + 1, bool)
    held[tuple((found.strips - low).T)] = True
    sizes = np.bincount(label(held)[0][held])[1:]
    assert sizes.max() > 0.98 * sizes.sum()


def test_masts_and_plates_thinner_than_a_cell_are_refused_where_they_are_longer_than_a_strip_may_be():
    mast = shapes.cylinder(0.03, 1.3, sections=8, rotation=(0.3, 0.2, 0), position=(1.5, 1.5, 1.5)).triangles
    plate = shapes.box((1.6, 1.4, 0.04), position=(0, 0, 0.03)).triangles @ rotation(np.array([0.4, 0.1, 0])).T + 1.5
    for body in (np.concatenate([box((8, 8, 8), (20, 20, 17)), mast]), plate):
        with pytest.raises(ValueError, match="too thin for cells"):
            mesh_lines(grid_of(body, CELL), body, 6)


def test_a_sheet_with_flat_sides_along_the_axes_runs_whatever_its_thickness_where_nodes_lie_in_it():
    found = mesh_lines(GRID, box((6, 5, 14.9), (24, 25, 15.1)))
    assert len(found.strips) == 0 == found.strip_area and np.isclose(found.volume[2], 0.072, rtol=0.01)


def test_a_wire_between_grid_lines_and_a_mast_on_a_body_are_refused():
    wire = shapes.cylinder(0.02, 2.0, sections=8, position=(1.55, 1.55, 0.5)).triangles
    refused(wire, r"too thin for cells of 0\.1 m: about 0\.0\d+ m thick")
    mast = shapes.cylinder(0.02, 1.0, sections=8, position=(1.55, 1.55, 1.6)).triangles
    refused(np.concatenate([box((8, 8, 8), (20, 20, 17)), mast]), r"too thin .* one at \[.*2\.\d+\] m")


def test_bodies_beyond_the_grid_and_specks_are_refused():
    refused(box((8, 8, 8), (29.5, 20, 20)), r"reach from .* to .* m, the grid from .* lattice_around")
    refused(box((8, 8, 8), (20, 20, 20)) * 1e-8 + 1.5, "all 12 triangles are smaller than .* give triangles in metres")
    refused(np.full((1, 3, 3), np.nan), "triangles.* is nan")


def test_meshes_of_vehicles_are_open_and_their_hulls_are_not(data_folder):
    """The open meshes are refused by the number of their open edges; a convex hull of them is a body."""
    import trimesh

    folder = data_folder / "meshes"
    for name, n in (("gazebo_vehicles_CC-BY-3.0/hatchback.obj", 8), ("bzflag_tank_LGPL21_or_MPL2/tank.obj", 60)):
        open_ = sarcl.Scene.from_mesh(folder / name).triangles
        size = np.ptp(open_.reshape(-1, 3), axis=0).max()
        refused(open_, rf"open at {n} of \d+ edges", grid_of(open_, size / 60))
        hull = trimesh.convex.convex_hull(open_.reshape(-1, 3)).triangles
        assert np.allclose(mesh_lines(grid_of(hull, size / 60), hull).volume, volume(hull), rtol=0.05)

"""Echoes of closed bodies through the public verb: Mie's series, physical optics, refusals, files, forecasts."""

from __future__ import annotations

import logging
from dataclasses import replace

import numpy as np
import pytest

import sarcl
from sarcl import shapes
from sarcl.base import host_memory
from sarcl.base.constants import SPEED_OF_LIGHT
from sarcl.base.report import root_sum_square
from sarcl.fullwave import runs
from sarcl.opencl.choose_device import devices, open_device
from sarcl.reference import mie
from sarcl.scene.triangles import rotation

RADIUS = 0.1  # m
CHIRP = sarcl.Waveform.chirp(center=1.25e9, bandwidth=500e6, duration=2e-8)  # ka 2.1 to 3.1
SPHERE = shapes.sphere(RADIUS, edge=0.02)
BOX = shapes.box((0.2, 0.3, 0.1))
THIN = shapes.box((0.3, 0.3, 0.005), rotation=(0.5, 0.2, 0))


def around(*degrees, height=0.0, distance=40.0):
    """Antennas about the z axis."""
    angle = np.deg2rad(degrees)
    return sarcl.Trajectory(None, np.stack([distance * np.cos(angle), distance * np.sin(angle), 0 * angle + height], 1))


def plan(*subjects, **options):
    """Forecast of full-wave echoes."""
    return sarcl.plan(sarcl.fullwave_echo, *subjects, **options)


def samples(raw):
    """(pulses, polarisations, frequencies), and wavenumbers, rad/m."""
    n = len(np.unique(raw.polarization))
    k = 2 * np.pi * (raw.frequency[0] + raw.frequency_step[0] * np.arange(raw.n_samples)) / SPEED_OF_LIGHT
    return np.asarray(raw.samples).reshape(-1, n, raw.n_samples), k


def difference(a, b):
    return float(np.linalg.norm(a - b) / np.linalg.norm(b))


@pytest.fixture(scope="module")
def sphere():
    """Two directions, with a run each."""
    return sarcl.fullwave_echo(SPHERE, CHIRP, around(20, 65, height=15.0), polarization=("HH", "VH"), cells=14)


def test_a_sphere_has_the_amplitude_and_phase_of_mie_in_every_direction(sphere):
    """|sample|^2 = RCS, phase zero at the centre; the mesh lies inside the sphere; cells of a tenth of its radius."""
    got, k = samples(sphere)
    wanted = np.array([mie.conducting_sphere(RADIUS, x)[0] for x in k])
    for horizontal, cross in got:
        assert difference(horizontal, wanted) < 0.04
        assert np.linalg.norm(cross) < 3e-3 * np.linalg.norm(wanted)


def test_another_reference_has_the_phases_that_echo_gives_a_point():
    given = {"reference": (0.3, -0.2, 0.1), "range_window": (-1.5, 1.5)}
    track = around(20, height=15.0)
    raw = sarcl.fullwave_echo(SPHERE, CHIRP, track, cells=14, model_error=False, **given)
    point = sarcl.echo(sarcl.Scene.points([SPHERE.center]), CHIRP, track, tolerance=1e-5, **given)
    got, k = samples(raw)
    wanted = np.array([mie.conducting_sphere(RADIUS, x)[0] for x in k]) * samples(point)[0][0, 0]
    assert np.array_equal(raw.reference_range, point.reference_range)
    assert np.ptp(np.angle(samples(point)[0])) > 1
    assert difference(got[0, 0], wanted) < 0.04


@pytest.mark.slow
def test_all_polarisations_are_those_of_runs_for_each(sphere):
    track = around(20, 65, height=15.0)
    options = {"cells": 14, "model_error": False}
    got, _ = samples(sarcl.fullwave_echo(SPHERE, CHIRP, track, polarization="all", **options))
    assert np.array_equal(got[:, [0, 2]], samples(sphere)[0])  # the same runs
    scale = np.linalg.norm(got[:, 0])
    for i, name in ((1, "HV"), (3, "VV")):
        alone, _ = samples(sarcl.fullwave_echo(SPHERE, CHIRP, track, polarization=name, **options))
        # weights of anchors follow from all polarisations that share their runs
        assert np.linalg.norm(got[:, i] - alone[:, 0]) < 1e-4 * scale
    assert difference(got[:, 3], got[:, 0]) < 0.02


def test_the_error_of_the_grid_is_predicted_within_a_factor_of_three(sphere):
    got, k = samples(sphere)
    wanted = np.array([mie.conducting_sphere(RADIUS, x)[0] for x in k])
    error = difference(got[:, 0], np.broadcast_to(wanted, (2, len(k))))
    assert error / 3 < sphere.report.model_error < 3 * error


def test_the_report_says_what_was_computed(sphere):
    choices = sphere.report.plan
    assert choices["anchors"] == [0, 1] and choices["runs"] == 2 and choices["cells"] == 14
    assert sphere.report.tolerance == 3e-2 and sphere.report.predicted_error <= 3e-2
    assert [term.name for term in sphere.report.error_terms] == ["waveform forming", "end of runs"]
    assert sphere.report.error_terms[1].value == pytest.approx(choices["left"], rel=0.05)
    assert sphere.report.predicted_error == root_sum_square(sphere.report.error_terms) > 0
    assert sphere.report.contributions_done == choices["runs"] * choices["steps"] * np.prod(
        [int(n) for n in choices["grid"].split(" x ")]
    )
    assert "predicted for the model itself" in str(sphere.report)


@pytest.mark.slow
def test_bistatic_echoes_of_a_sphere_are_those_of_mie():
    """Both antennas in the plane z = 0: V is across it. Mie's fields in the plane have the sense opposite to H."""
    tx, rx = around(0.0), around(110.0)
    raw = sarcl.fullwave_echo(
        SPHERE, CHIRP, tx, receiver=rx, polarization=("HH", "VV"), cells=14, model_error=False, range_window=(-1, 1)
    )
    (got,), k = samples(raw)
    across, along = np.array([mie.conducting_sphere(RADIUS, x, np.pi - np.deg2rad(110)) for x in k]).T
    assert difference(got[1], across) < 0.04
    assert difference(got[0], -along) < 0.04


def lattice_of(scene):
    """The grid about a scene, 12 cells per wavelength of 1.5 GHz."""
    return sarcl.fullwave_echo.planned(scene, CHIRP, around(20, 30), cells=12, max_bytes=1e9).task.lattice


@pytest.mark.parametrize("size", [(0.31, 0.43, 0.22), (0.2, 0.3, 0.1), (1.0, 0.05, 0.33)])
def test_flat_sides_of_a_box_lie_on_nodes_or_little_outside(size):
    box = shapes.box(size, position=(3.0, -2.0, 7.0))
    cell = SPEED_OF_LIGHT / 1.5e9 / 12
    lattice = lattice_of(box)
    assert cell / runs.FINER <= lattice.cell <= cell
    low, high = (box.bounds - lattice.origin) / lattice.cell
    outside = np.ceil(low - 1e-6) - low, high - np.floor(high + 1e-6)
    assert np.allclose(*outside, atol=1e-6) and np.max(outside) < 0.3
    assert (low >= runs.ABSORBER + runs.GAP).all() and (
        np.array(lattice.shape) - high >= runs.ABSORBER + runs.GAP
    ).all()
    assert lattice.shape == tuple(runs.grid_shape(box.bounds, lattice.cell, np.ones((2, 3), bool)))


def test_the_base_of_a_cone_lies_on_nodes_and_a_sphere_in_the_middle_of_its_grid():
    cone = lattice_of(shapes.cone(0.2, 0.4))
    assert np.isclose(cone.origin[2] / cone.cell % 1, [0, 1], atol=1e-6).any()
    below = lattice_of(shapes.cone(0.2, 0.4, rotation=(np.pi, 0, 0)))
    assert np.isclose(below.origin[2] / below.cell % 1, [0, 1], atol=1e-6).any()
    ball = lattice_of(SPHERE)
    assert np.isclose(ball.cell, SPEED_OF_LIGHT / 1.5e9 / 12)
    assert np.allclose(ball.centre, 0, atol=ball.cell * (1 + 1e-9) * np.array([1e-6, 1e-6, 0.5]))


@pytest.mark.parametrize(
    "scene, options, error, message",
    [
        (BOX + sarcl.Scene.points([[0, 0, 0]]), {}, ValueError, r"scene has 1 points, .* add the samples that echo"),
        (sarcl.Scene.from_heights([0, 1], [0, 1], np.zeros((2, 2))), {}, ValueError, "terrain, .* use echo"),
        (shapes.box((1, 1, 1), roughness=0.1), {}, ValueError, "12 facets with a random roughness, .* roughness=0"),
        (shapes.box((1, 1, 1), reflectivity=0.5), {}, ValueError, r"reflectivity 0\.5, .*\.Material\(eps_r=3"),
        (shapes.box((1, 1, 1), material=sarcl.Material(diagram="cos")), {}, ValueError, "finer than a facet"),
        (shapes.box((1, 1, 1), material="concrete"), {"cells": 12}, ValueError,
         r"5\.2 cells .* 'concrete' .* cells=13\.9, or"),
        (shapes.box((1, 1, 1), material=sarcl.Material(eps_r=9)), {"cells": 12}, ValueError,
         "in a material of relative perm"),
        (shapes.plate((0.3, 0.2)), {}, ValueError, "are open at 4 of 5 edges"),
        (THIN, {}, ValueError, r"about 0\.005 m thick, .* at most 0\.0035 m, .*: cells=5\d\.\d, which are 12 now"),
        (shapes.box((1e-5, 2e-5, 1e-5)), {}, ValueError, r"over 2e-05 m, less .* at most 1\.4e-05 m.*: cells=\d+"),
        (shapes.box((0.3, 0.3, 0.001), rotation=(0.5, 0.2, 0), material=sarcl.Material(2)), {"cells": 12}, ValueError,
         r"parts\[0\], on cells of half the size: .* too thin .*: cells=1\d\d\.\d, which are 12 now"),
        (BOX, {"cells": 7}, ValueError, r"cells is 7 .* reaches 1\.5 GHz, .* at least 8 .* up to 1\.312 GHz"),
        (BOX, {"max_bytes": 2e6}, MemoryError, r"cells: it needs 7\.\d+ MB, and 2 MB are allowed; raise max_bytes"),
        (BOX, {"max_bytes": 6e6}, MemoryError, r"what fits is a waveform up to 1\.\d+ GHz with cells=8; or raise"),
        (BOX, {"max_bytes": 2e7, "cells": 40}, MemoryError, r"what fits is cells=\d+\.?\d*, or a waveform up to"),
        (BOX, {"tolerance": 1e-5}, sarcl.ToleranceUnreachable, r"with fields in float32; the best here is 1\.0e-04"),
        (BOX, {"anchors": 2}, ValueError, "anchors is 2, and the track has 1 pulses"),
        (BOX, {"anchors": [0, 0]}, ValueError, r"anchors is \[0, 0\]; give numbers of pulses from 0 to 0, each once"),
        (BOX, {"anchors": "all"}, ValueError, "anchors is 'all'; choose one of 'auto'"),
        (BOX, {"range_window": (-0.1, 0.1)}, ValueError, "does not hold the scene, from .* give a wider window"),
        (BOX, {"out": 3}, TypeError, "out is a int; give the name of a file such as 'raw.h5', or None"),
        (shapes.box((90, 90, 1)), {}, ValueError, "track position 0 is 40 m from .* reaches 63.64 m"),
    ],
)  # fmt: skip
def test_what_the_grid_cannot_hold_is_refused_by_plan_and_run_alike(scene, options, error, message):
    for function in (sarcl.fullwave_echo, plan):
        with pytest.raises(error, match=message):
            function(scene, CHIRP, around(20), **options)


def test_a_plate_that_the_grid_of_the_model_error_does_not_resolve_is_refused_before_any_run(monkeypatch):
    done = pretend(monkeypatch)
    plate = shapes.box((0.3, 0.3, 0.03), rotation=(0.5, 0.2, 0))  # 1.8 cells; 1.2 of the larger ones
    thin = shapes.box((0.3, 0.3, 0.018), rotation=(0.5, 0.2, 0))
    for function in (sarcl.fullwave_echo, plan):
        function(plate, CHIRP, around(20), cells=14)
        with pytest.raises(ValueError, match=r"model_error takes a run with cells .* model_error=False, or cells=\d+"):
            function(thin, CHIRP, around(20), cells=14)
    assert len(done) == 2  # of the plate
    sarcl.fullwave_echo(thin, CHIRP, around(20), cells=14, model_error=False)


def finned(width, thickness):
    """A block of 0.12 x 0.3 x 0.06 m with a strip of a width and a thickness, m, along the middle of a side; turned."""
    z, x = 0.03, 0.12
    outline = [(0, -z), (x, -z), (x, -thickness / 2), (x + width, -thickness / 2)]
    outline = np.array(outline + [(a, -b) for a, b in outline[::-1]])
    corners = np.array([[a, y, b] for y in (0, 0.3) for a, b in outline])
    cut = [(0, 1, 2), (0, 2, 5), (0, 5, 7), (7, 5, 6), (2, 3, 4), (2, 4, 5)]
    faces = [*cut, *[(c + 8, b + 8, a + 8) for a, b, c in cut]]
    for i, j in zip(range(8), (*range(1, 8), 0), strict=True):
        faces += [(j, i, i + 8), (j, i + 8, j + 8)]
    body = corners[np.array(faces)]
    body = body if np.linalg.det(body).sum() > 0 else body[:, ::-1]
    return sarcl.Scene.facets((body - corners.mean(axis=0)) @ rotation(np.array([0.1, 0.2, 0.3])).T)


STRIP_CHIRP = sarcl.Waveform.chirp(center=0.9e9, bandwidth=200e6, duration=2e-8)  # wavelength 0.3 m at its upper end


def test_a_strip_thinner_than_a_cell_runs_up_to_a_tenth_of_a_wavelength_and_is_said(monkeypatch):
    """With 45 cells per wavelength its thickness is half a cell, and its width 3.6 cells, more than RIM."""
    done = pretend(monkeypatch)
    for function in (sarcl.fullwave_echo, plan):
        got = function(finned(0.024, 0.0036), STRIP_CHIRP, around(10), cells=45)
        said = (got.plan if function is plan else got.report.plan)["strips"]
        assert said.endswith("m^2 thinner than a cell, as sheets")
        assert np.isclose(float(said.split()[0]), 0.3 * 0.024, rtol=0.1)
        with pytest.raises(ValueError, match="too thin for cells of"):
            function(finned(0.048, 0.0036), STRIP_CHIRP, around(10), cells=45)
    assert len(done) == 2
    assert "strips" not in plan(BOX, CHIRP, around(20), cells=8).plan


@pytest.mark.slow
def test_a_strip_thinner_than_a_cell_has_its_echo_within_the_error_that_is_predicted():
    """Against cells of less than its thickness. Without the strip HH differs by 30 %."""
    track = sarcl.Trajectory(None, 40 * np.array([[0.9698, 0.171, 0.1736]]))
    body, options = finned(0.024, 0.0054), {"polarization": ("HH", "VV"), "anchors": 1}
    wanted = np.asarray(sarcl.fullwave_echo(body, STRIP_CHIRP, track, cells=70, model_error=False, **options).samples)
    raw = sarcl.fullwave_echo(body, STRIP_CHIRP, track, cells=30, **options)
    error = difference(np.asarray(raw.samples), wanted)
    assert error < 0.08 and error < raw.report.model_error < 3 * error + 0.05


@pytest.mark.slow
@pytest.mark.parametrize("radius, cells", [(0.1, 20), (0.05, 20)])
def test_losses_that_are_the_same_at_all_frequencies_are_an_error_over_a_wide_band_that_is_predicted(radius, cells):
    """Permittivity 3 - 1j from 1 to 1.5 GHz: the conductivity on the grid has 1.25 and 0.83 for 1 at the ends."""
    material = sarcl.Material(eps_r=3 - 1j)
    ball = shapes.sphere(radius, facets=8000, rotation=(0.3, 0.5, -0.2), material=material)
    errors = []
    for chirp in (CHIRP, sarcl.Waveform.chirp(center=1.25e9, bandwidth=25e6, duration=2e-8)):
        raw = sarcl.fullwave_echo(ball, chirp, around(30, height=15.0), cells=cells)
        (got,), k = samples(raw)
        error = difference(got[0], np.array([mie.dielectric_sphere(radius, one, 3 - 1j)[0] for one in k]))
        assert error < raw.report.model_error < 2.5 * error
        errors.append(error)
    assert errors[1] < 0.035 < errors[0]


@pytest.mark.parametrize("seed", range(6))
def test_scenes_of_metal_and_dielectric_boxes_are_forecast_and_run(monkeypatch, seed):
    pretend(monkeypatch)
    rng = np.random.default_rng(seed)
    metal = shapes.box((0.2, 0.2, 0.2), position=rng.uniform(-0.3, 0.3, 3))
    block = shapes.box((0.1, 0.1, 0.1), position=rng.uniform(-0.3, 0.3, 3), material=sarcl.Material(2))
    forecast = plan(metal + block, CHIRP, around(20))
    raw = sarcl.fullwave_echo(metal + block, CHIRP, around(20))
    assert forecast.plan["grid"] == raw.report.plan["grid"] and forecast.plan["cells"] == raw.report.plan["cells"]


def test_gaps_that_the_grid_closes_are_said_with_the_cells_that_leave_them_open(monkeypatch):
    """With 16 cells the echo was that of the closed box, and differed by 43 % from those of 20 cells and more."""
    pretend(monkeypatch)
    halves = shapes.box((0.1, 0.1, 0.1)) + shapes.box((0.1, 0.1, 0.1), position=(0.112, 0, 0))
    message = r"gaps of about 0\.012 m, narrower than .* cells=23\.8, which are 16 now, or close the gaps"
    with pytest.warns(sarcl.SarclWarning, match=message):
        sarcl.fullwave_echo(halves, CHIRP, around(20), cells=16)
    sarcl.fullwave_echo(halves, CHIRP, around(20), cells=23.8)


@pytest.mark.parametrize("width", [0.02, 0.3, 0.7, 0.95])
@pytest.mark.parametrize("turned", [0.0, 0.4])
def test_a_gap_narrower_than_a_cell_is_named_once_whether_nodes_lie_in_it_or_not(monkeypatch, width, turned):
    """Waves go to and fro in it: the currents that are left are no second warning."""
    done = pretend(monkeypatch, left=0.5)
    gap = width * SPEED_OF_LIGHT / 1.5e9 / 8
    halves = [shapes.box((0.1, 0.1, 0.1), position=(side * (0.1 + gap) / 2, 0, 0)).triangles for side in (-1, 1)]
    body = np.concatenate(halves) @ rotation(np.array([0.3, turned, 2 * turned])).T
    task = sarcl.Scene.facets(body if turned else np.concatenate(halves)), CHIRP, around(20, 65)
    with pytest.warns(sarcl.SarclWarning) as said:
        sarcl.fullwave_echo(*task, polarization="all", cells=8, model_error=False)
    assert len(done) == 4
    assert [f"gaps of about {gap:.2g} m, narrower than cells" in str(one.message) for one in said] == [True]


def test_currents_that_are_left_are_said_once(monkeypatch):
    pretend(monkeypatch, left=0.5)
    with pytest.warns(sarcl.SarclWarning) as said:
        sarcl.fullwave_echo(BOX, CHIRP, around(20, 65), polarization="all", cells=8, model_error=False)
    assert ["of the currents would have followed" in str(one.message) for one in said] == [True]


def pretend(monkeypatch, stop_after=None, left=0.0):
    """Runs of the grid replaced by random echoes; the list of those that are done. The one after `stop_after` fails."""
    done = []

    def run(device, lattice, target, band, k, *, anchor, antennas, options):
        if len(done) == stop_after:
            raise RuntimeError("the machine is switched off")
        done.append((anchor.place, anchor.sent))
        random = np.random.default_rng(int(1e6 * abs(np.concatenate(done[-1]).sum())))
        made = (random.normal(size=(len(antennas.tx), len(antennas.received), len(k), 2)) @ [1, 1j]).astype(
            np.complex64
        )
        return [made, 2 * made][: 1 + (anchor.twin is not None)], runs.RunEnd(100, left)

    monkeypatch.setattr(runs, "run", run)
    return done


def test_an_interrupted_task_continues_from_its_finished_runs(tmp_path, monkeypatch, caplog):
    out, track = tmp_path / "raw.h5", around(20, 65)
    given = {"cells": 8, "model_error": False, "polarization": ("VV", "HV", "HH")}
    assert len(pretend(monkeypatch)) == 0
    whole = sarcl.fullwave_echo(BOX, CHIRP, track, **given)
    pretend(monkeypatch, stop_after=3)
    with pytest.raises(RuntimeError, match="switched off"):
        sarcl.fullwave_echo(BOX, CHIRP, track, out=out, resume=True, **given)
    kept = sorted((tmp_path / "raw.h5.anchors").glob("*.tiles"))
    assert not out.exists() and len(kept) == 3
    damaged = bytearray(kept[0].read_bytes())
    damaged[-100] ^= 1
    kept[0].write_bytes(damaged)
    kept[1].write_bytes(kept[1].read_bytes()[:20])
    done = pretend(monkeypatch)
    raw = sarcl.fullwave_echo(BOX, CHIRP, track, out=out, **given)
    assert len(done) == 3 and caplog.text.count("its tiles are made again") == 2
    assert np.array_equal(np.asarray(raw.samples), np.asarray(whole.samples)) and not kept[0].parent.exists()
    assert sarcl.read(out).report.plan["anchors"] == whole.report.plan["anchors"] == [0, 1]


SCENARIO = """
[waveform.chirp]
center = 1.25e9
bandwidth = 500e6
duration = 2e-8
[trajectory.circle]
radius = 40
height = 15
arc = 0.1
n_pulses = 3
[[scene.box]]
size = [0.2, 0.3, 0.1]
[fullwave_echo]
cells = 8
polarization = ["HH", "VH"]
anchors = [0, 2]
model_error = false
"""


def test_a_scenario_describes_full_wave_echoes(monkeypatch):
    done = pretend(monkeypatch)
    scenario = sarcl.scenario.loads(SCENARIO)
    forecast, raw = scenario.plan(), scenario.simulate()
    assert len(done) == 2 == forecast.plan["runs"] and raw.report.plan["anchors"] == [0, 2]
    assert (raw.n_rows, raw.n_samples) == (forecast.n_rows, forecast.n_samples) == (6, 64)
    assert sarcl.scenario.loads(scenario.dumps()).tables == scenario.tables
    with pytest.raises(ValueError, match=r"f\.toml:\d+: \[radar\] goes with \[echo\], .* leave \[radar\] out"):
        sarcl.scenario.loads(SCENARIO + "[radar]\npower = 10\n", name="f.toml").simulate()
    with pytest.raises(ValueError, match=r"f\.toml:14: \[fullwave_echo\] cells is 7 "):
        sarcl.scenario.loads(SCENARIO.replace("cells = 8", "cells = 7"), name="f.toml").simulate()


@pytest.mark.slow
def test_progress_counts_steps_of_all_runs():
    seen = []
    raw = sarcl.fullwave_echo(
        BOX, CHIRP, around(20, 65), cells=8, progress=lambda *report: seen.append(report)
    )  # fmt: skip
    stages = [report for report in seen if report[0] == "full-wave runs"]
    assert raw.report.plan["runs"] == 2 and stages[0][1] == 0 and stages[-1][1] == stages[-1][2]
    assert np.all(np.diff([done for _, done, _ in stages]) >= 0) and len(stages) > 6


def test_the_forecast_says_memory_steps_and_runs_before_the_work(monkeypatch):
    monkeypatch.setattr(runs, "run", None)
    forecast = plan(BOX, CHIRP, around(20, 65), polarization="all", cells=8, out="nowhere/raw.h5")
    assert (forecast.method, forecast.n_rows, forecast.n_samples, forecast.plan["runs"]) == ("full wave", 8, 64, 4)
    assert forecast.plan["grid"] == "38 x 42 x 48" and 1e6 < forecast.plan["run_bytes"] < forecast.bytes < 2e7
    assert forecast.seconds > forecast.planning + forecast.plan["runs"] * forecast.plan["run_seconds"]
    assert "about 4 runs of 38 x 42 x 48 cells" in str(forecast) and forecast.model_error is None


def test_the_forecast_bounds_the_error_that_anchors_reach_and_knows_none_of_given_ones():
    """No tolerance bounds the error of the grid."""
    track = around(20, 30, 50)
    forecast = plan(BOX, CHIRP, track, cells=8, model_error=False)
    assert forecast.predicted_error == root_sum_square(forecast.error_terms) <= 3e-2
    terms = [(term.name, term.remedy) for term in forecast.error_terms]
    assert terms == [("waveform forming", "a smaller tolerance"), ("end of runs", "a smaller tolerance")]
    given = plan(BOX, CHIRP, track, cells=8, anchors=2)
    assert np.isnan(given.predicted_error) and "error known after the run" in str(given)
    assert plan(BOX, CHIRP, around(20), cells=8, anchors=1).predicted_error == pytest.approx(1e-3)
    raw = forecast.run()
    assert raw.report.predicted_error <= forecast.predicted_error and forecast.predicted_error > 0


def test_a_forecast_runs_its_own_plan_which_cuts_the_bodies_once(monkeypatch):
    track, given = around(20), {"cells": 8.5, "polarization": ("HH", "VH")}
    box = shapes.box((0.1, 0.15, 0.1), material=sarcl.Material(eps_r=2 - 0.1j))
    whole = sarcl.fullwave_echo(box, CHIRP, track, **given)
    cuts, cut = [], runs.target_of
    monkeypatch.setattr(runs, "target_of", lambda *args: (cuts.append(args), cut(*args))[1])
    forecast = plan(box, CHIRP, track, **given)
    assert len(cuts) == 2  # by the grid, and by larger cells
    for raw in (forecast.run(), forecast.run()):
        assert np.array_equal(np.asarray(raw.samples), np.asarray(whole.samples))
        for name in ("predicted_error", "error_terms", "model_error", "contributions_done"):
            assert getattr(raw.report, name) == getattr(whole.report, name)
        assert set(raw.report.seconds) == {"plan", "files", "full-wave runs", "forming"}
    assert len(cuts) == 3  # and with the conductivity at the upper end of the band


def test_out_is_checked_by_the_run_and_not_written_by_the_forecast(tmp_path, monkeypatch):
    pretend(monkeypatch)
    forecast = plan(BOX, CHIRP, around(20), cells=8, out=tmp_path / "nowhere" / "raw.h5")
    assert not list(tmp_path.iterdir())
    with pytest.raises(FileNotFoundError):
        forecast.run()


def test_a_run_of_half_the_frequencies_takes_between_half_and_all_of_the_time():
    options = {"polarization": "all", "cells": 8, "model_error": False, "range_window": (-100, 100)}
    whole = plan(BOX, CHIRP, around(20), **options)
    halves = plan(BOX, CHIRP, around(20), max_bytes=0.75 * whole.plan["run_bytes"], **options)
    assert halves.plan["runs"] == 2 * whole.plan["runs"]
    assert 0.5 * whole.plan["run_seconds"] < halves.plan["run_seconds"] < whole.plan["run_seconds"]


def test_the_report_says_which_conductivity_a_complex_permittivity_becomes(monkeypatch):
    """eps'' = sigma/(omega eps_0) at 1.25 GHz: 0.05 is 3.48 mS/m."""
    pretend(monkeypatch)
    box = shapes.box((0.2, 0.3, 0.1), material=sarcl.Material(eps_r=3 - 0.05j, conductivity=0.01))
    given = box + shapes.box((0.1, 0.1, 0.1), position=(1, 0, 0)), CHIRP, around(20)
    said = "eps_r 3-0.05j as 0.0135 S/m, exact at 1.25 GHz"
    raw = sarcl.fullwave_echo(*given, cells=12, model_error=False)
    assert raw.report.plan["losses"] == plan(*given, cells=12).plan["losses"] == said
    assert "losses" not in sarcl.fullwave_echo(BOX, CHIRP, around(20), cells=8, model_error=False).report.plan


def test_a_forecast_says_the_memory_it_assumed_which_is_not_what_is_free(monkeypatch):
    """Drivers of CPUs give less memory while other programs take some."""
    if not any(info.works and info.kind == "cpu" for info in devices()):
        pytest.skip("no CPU device works here")
    options = {"cells": 8, "range_window": (-100, 100), "device": "cpu"}
    plain = plan(BOX, CHIRP, around(20), **options).plan
    assert plain["max_bytes"] == host_memory.installed() / 2 and plain["memory"] == "0.5 of what is installed"
    device = open_device("cpu")
    monkeypatch.setattr(device, "info", replace(device.info, memory=int(1.5 * plain["run_bytes"])))
    assert plan(BOX, CHIRP, around(20), **options | {"device": device}).plan["runs"] == plain["runs"]
    monkeypatch.setattr(host_memory, "installed", lambda: 1.5 * plain["run_bytes"])
    forecast = plan(BOX, CHIRP, around(20), **options)
    less = forecast.plan
    assert less["parts"] > plain["parts"] == 1 and less["runs"] == less["parts"] * plain["runs"]
    assert "with at most" in str(forecast) and "(max_bytes, 0.5 of what is installed)" in str(forecast)
    again = plan(BOX, CHIRP, around(20), **options, max_bytes=plain["max_bytes"]).plan
    assert (again["runs"], again["run_bytes"], again["memory"]) == (plain["runs"], plain["run_bytes"], "as given")


@pytest.mark.parametrize(
    "eps_r, tolerance, cells",
    [(None, 3e-2, 12), (None, 1e-3, 12), (1.2, 3e-2, 12), (3, 3e-2, 17.4), (3, 1.5e-2, 24.5), (3, 1e-3, 34.7),
     (3, 0.2, 13.9), (4 - 3j, 3e-2, 22.4)],
)  # fmt: skip
def test_cells_are_chosen_by_permittivity_and_tolerance_and_said(monkeypatch, eps_r, tolerance, cells):
    """12 of a vacuum wavelength in conductors, and 10 sqrt(3e-2/tolerance) of one in the body, from 8 to 20."""
    pretend(monkeypatch)
    box = shapes.box((0.02, 0.03, 0.02), material="metal" if eps_r is None else sarcl.Material(eps_r))
    said = plan(box, CHIRP, around(20), tolerance=tolerance).plan
    raw = sarcl.fullwave_echo(box, CHIRP, around(20), tolerance=tolerance, model_error=False)
    assert cells <= raw.report.plan["cells"] <= 1.07 * cells and raw.report.plan["cells"] == said["cells"]


def test_the_log_is_quiet_without_files(caplog):
    caplog.set_level(logging.WARNING)
    plan(BOX, CHIRP, around(20))
    assert not caplog.records


@pytest.mark.slow
@pytest.mark.parametrize(
    "eps_r, conductivity, radius, cells, allowed",
    [(3, 0, 0.1, 20, 0.02), (3, 0, 0.1, 12, 0.06), (3, 0, 0.1115, 20, 0.03), (2, 0, 0.05, 14, 0.045),
     (5, 0, 0.05, 22, 0.04), (3, 0.05, 0.1, 20, 0.035), (3, 0.05, 0.05, 20, 0.03)],
)  # fmt: skip
def test_a_dielectric_sphere_has_the_echo_of_mie_and_the_error_that_is_predicted(
    eps_r, conductivity, radius, cells, allowed
):
    """0.1115 m: ka 2.3 to 3.5."""
    material = sarcl.Material(eps_r=eps_r, conductivity=conductivity)
    ball = shapes.sphere(radius, facets=8000, material=material)
    raw = sarcl.fullwave_echo(ball, CHIRP, around(30, height=15.0), cells=cells)
    (got,), k = samples(raw)
    inside = material.permittivity(k * SPEED_OF_LIGHT / (2 * np.pi))
    wanted = [mie.dielectric_sphere(radius, *at)[0] for at in zip(k, inside, strict=True)]
    error = difference(got[0], np.array(wanted))
    assert error < allowed and error / 2.5 < raw.report.model_error < 2.5 * error


@pytest.mark.slow
def test_a_sphere_of_permittivity_three_with_twenty_cells_has_an_error_below_three_percent():
    """ka 2.8 to 3.5, in three directions to the grid."""
    radius = 3.5 * SPEED_OF_LIGHT / (2 * np.pi * 1.5e9)
    chirp = sarcl.Waveform.chirp(center=1.35e9, bandwidth=300e6, duration=2e-8)
    ball = shapes.sphere(radius, facets=8000, rotation=(0.3, 0.5, -0.2), material=sarcl.Material(3))
    raw = sarcl.fullwave_echo(ball, chirp, around(0, 30, 75, height=15.0), cells=20, anchors=3, model_error=False)
    got, k = samples(raw)
    assert np.isclose(k[[0, -1]] * radius, [2.8, 3.5], atol=0.05).all()
    wanted = np.array([mie.dielectric_sphere(radius, one, 3.0)[0] for one in k])
    for echoes in got[:, 0]:
        assert difference(echoes, wanted) < 0.03


@pytest.mark.slow
def test_a_large_plate_at_normal_incidence_is_that_of_physical_optics():
    """Four wavelengths wide: edges, which physical optics leaves out, change less than 0.3 dB."""
    plate, track = shapes.box((0.12, 0.9, 0.9), position=(0, 0, -0.45)), around(0, distance=400.0)
    options = {"polarization": ("HH", "VV"), "reference": (0.06, 0, 0)}
    got, _ = samples(sarcl.fullwave_echo(plate, CHIRP, track, cells=10, model_error=False, **options))
    wanted, _ = samples(sarcl.echo(plate, CHIRP, track, **options))
    assert got.shape == wanted.shape
    ratio = (got * wanted.conj()).sum(axis=(0, 2)) / (np.abs(wanted) ** 2).sum(axis=(0, 2))
    assert np.abs(20 * np.log10(np.abs(ratio))).max() < 0.3 and np.abs(np.angle(ratio)).max() < 0.06
    assert difference(got, wanted) < 0.06


@pytest.mark.slow
def test_frequencies_that_do_not_fit_into_memory_take_runs_of_their_own():
    options = {"cells": 8, "polarization": "VV", "model_error": False}
    whole = sarcl.fullwave_echo(BOX, CHIRP, around(20), **options)
    parts = sarcl.fullwave_echo(BOX, CHIRP, around(20), max_bytes=6.8e6, **options)
    assert whole.report.plan["runs"] == 1 < parts.report.plan["runs"] < 8
    assert parts.report.plan["run_bytes"] <= 6.8e6 < whole.report.plan["run_bytes"]
    assert difference(np.asarray(parts.samples), np.asarray(whole.samples)) < 1e-5


@pytest.mark.slow
def test_a_check_measures_the_error_between_anchors():
    track = around(*np.linspace(20, 40, 9))
    raw = sarcl.fullwave_echo(BOX, CHIRP, track, cells=8, anchors=[0, 2, 6, 8], check=True, model_error=False)
    whole = sarcl.fullwave_echo(BOX, CHIRP, track, cells=8, anchors=range(9), model_error=False)
    wrong = np.abs(np.asarray(raw.samples) - np.asarray(whole.samples)) ** 2
    one = float(np.sqrt(9 * wrong[4].sum() / (np.abs(np.asarray(raw.samples)) ** 2).sum()))
    assert np.isclose(raw.report.measured_error, one, rtol=1e-3) and raw.report.measured_error < 3e-2
    assert whole.report.predicted_error < 1e-3
    with pytest.raises(sarcl.ToleranceMissed) as missed:
        sarcl.fullwave_echo(BOX, CHIRP, track, cells=8, anchors=1, check=True, model_error=False, tolerance=1e-3)
    assert missed.value.raw.n_rows == 9 and missed.value.raw.report.measured_error > 1e-3


@pytest.mark.slow
def test_one_run_serves_two_anchors_of_a_body_that_is_its_own_mirror_image(monkeypatch):
    track = around(*np.linspace(-40, 40, 7), height=20.0)
    options = {"cells": 8, "polarization": ("HH", "VH", "VV"), "model_error": False, "anchors": range(7)}
    both = sarcl.fullwave_echo(BOX, CHIRP, track, **options)
    monkeypatch.setattr(runs, "mirror_twins", lambda *args: {})
    alone = sarcl.fullwave_echo(BOX, CHIRP, track, **options)
    assert (both.report.plan["runs"], both.report.plan["mirrored"]) == (8, 6)
    assert (alone.report.plan["runs"], alone.report.plan["mirrored"]) == (14, 0)
    assert difference(np.asarray(both.samples), np.asarray(alone.samples)) < 5e-3

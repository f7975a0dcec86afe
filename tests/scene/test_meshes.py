"""Meshes that nobody here made: each loads at its scale, echoes, and focuses where it stands. None is watertight."""

from __future__ import annotations

import numpy as np
import pytest

import sarcl
from sarcl.scene.triangles import areas, edges

VEHICLES, BOATS = "gazebo_vehicles_CC-BY-3.0", "vrx_boats_Apache-2.0"

# file -> (metres per unit, least and most length, width and height a thing of its kind has, m)
MESHES = {
    f"{VEHICLES}/ambulance.obj": (0.0254, (6, 8), (2, 3), (2.3, 3.2)),
    f"{VEHICLES}/bus.obj": (0.01, (10, 13), (2.4, 3), (3, 4)),
    f"{VEHICLES}/fire_truck.obj": (0.1, (9, 13), (2.4, 3.6), (3, 4)),
    f"{VEHICLES}/hatchback.obj": (0.0254, (3.5, 4.5), (1.6, 2.2), (1.4, 1.7)),
    f"{VEHICLES}/suv.obj": (0.06, (4.3, 5.5), (1.8, 2.7), (1.6, 2.3)),
    f"{VEHICLES}/prius_hybrid.obj": (0.01, (4.3, 4.8), (1.7, 2.2), (1.4, 1.7)),
    f"{VEHICLES}/pickup.dae": (0.0254, (5, 6.2), (1.8, 2.6), (1.6, 2.1)),
    f"{BOATS}/WAM-V-Base.dae": (0.01, (4.5, 5.5), (2.2, 2.8), (1, 1.6)),
    f"{BOATS}/roboboat01.dae": (0.01, (1, 1.5), (0.7, 1.1), (0.3, 0.5)),
    f"{BOATS}/roboboat02.dae": (0.01, (1, 1.6), (0.7, 1.1), (0.3, 0.5)),
    "bzflag_tank_LGPL21_or_MPL2/tank.obj": (1, (5, 10), (2, 4), (1.5, 3)),
}
CHIRP = sarcl.Waveform.chirp(center=9.6e9, bandwidth=200e6, duration=1e-6)  # cells of 0.75 m: few facets
TRACK = sarcl.Trajectory.circle(radius=7e3, height=5e3, start=0.3, arc=0.02, n_pulses=48)  # next ambiguity 45 m away


@pytest.fixture(params=MESHES, ids=lambda name: name.split("/")[-1])
def mesh(request, data_folder):
    """(scene at its scale, least and most length, width, height)"""
    path = data_folder / "meshes" / request.param
    if not path.is_file():
        pytest.skip(f"no mesh {request.param} in SARCL_DATA")
    scale, *sizes = MESHES[request.param]
    return sarcl.Scene.from_mesh(path, scale=scale), sizes


def test_a_mesh_has_the_size_of_its_kind(mesh):
    scene, (length, width, height) = mesh
    x, y, z = scene.bounds[1] - scene.bounds[0]
    assert length[0] <= max(x, y) <= length[1]
    assert width[0] <= min(x, y) <= width[1]
    assert height[0] <= z <= height[1]


def test_a_mesh_that_is_not_watertight_reflects_from_both_sides(mesh):
    scene, _ = mesh
    assert scene.two_sided.all() and np.isfinite(scene.triangles).all()


def test_cutting_a_mesh_keeps_its_surface(mesh):
    scene, _ = mesh
    cut = scene.split(0.3)
    assert edges(cut.triangles).max() <= 0.3
    # float64 corners of needles leave rounding of 1e-16 (length/width) of their area
    assert areas(cut.triangles).sum() == pytest.approx(areas(scene.triangles).sum(), rel=1e-9)


SEEN = ("hatchback.obj", "pickup.dae")  # of each format and size; boats, of 5000 facets, take 10 s


@pytest.mark.parametrize(
    "mesh",
    [pytest.param(name, marks=[] if name.endswith(SEEN) else [pytest.mark.slow]) for name in MESHES],
    ids=lambda name: name.split("/")[-1],
    indirect=True,
)
@pytest.mark.filterwarnings("ignore:mesh too coarse")  # as such models are
def test_a_mesh_echoes_and_focuses_where_it_stands(mesh):
    scene, _ = mesh
    raw = sarcl.echo(scene, CHIRP, TRACK)
    assert np.isfinite(raw.samples).all() and np.abs(raw.samples).max() > 0
    assert raw.report.predicted_error <= 1e-3 and raw.report.contributions_skipped["shadowed"] > 0

    grid = sarcl.ImageGrid.plane(center=scene.center, shape=(80, 80), spacing=0.5)
    image = sarcl.backproject(raw, grid, window="hamming")
    power = np.abs(image.data) ** 2
    assert np.isfinite(power).all() and power.max() > 0
    # a Hamming window's lobe reaches two cells of 0.92 m; height h is laid over by h tan(grazing), 0.7 h here
    margin = 2 + 0.7 * np.ptp(scene.bounds[:, 2])
    low, high = scene.bounds[0] - margin, scene.bounds[1] + margin
    inside = ((grid.positions >= low) & (grid.positions <= high))[..., :2].all(axis=-1)
    assert power[inside].sum() > 0.99 * power.sum()

"""Scenarios reach materials, parts of meshes, shapes, elevation models, and what stands on the ground."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

import sarcl
from sarcl import shapes
from sarcl.scenario.scenario import Scenario, load, loads
from sarcl.scene.material import MATERIALS, METAL

TEXT = """
[materials.clay]
eps_r = 9.0
conductivity = 0.4
height = 0.01
diagram = "exp"
width = 0.3

[materials.steel]
conductivity = inf
reflectivity = 0.8

[[scene.from_heights]]
x = [-20, 0, 20]
y = [-20, 20]
z = [[1, 1, 1], [1, 1, 1]]
material = [["clay", "wet soil"]]
point_roughness = 0.02

[[scene.box]]
size = [2, 2, 3]
on = [10, -5]
material = "steel"
rotation = 0.5

[[scene.cone]]
radius = 2
height = 4
sections = 12
on = [-10, 5, 0.5]
material = 0.3
"""


def same(a, b):
    for name in ("positions", "amplitudes", "triangles", "reflectivity", "roughness", "two_sided", "point_roughness"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name))
    assert [a.materials[i] for i in a.material] == [b.materials[i] for i in b.material]


def test_tables_are_the_calls_they_are_named_after():
    scene = loads(TEXT).build_scene()
    clay = sarcl.Material(9, 0.4, 0.01, "exp", 0.3, name="clay")
    steel = sarcl.Material(conductivity=np.inf, reflectivity=0.8, name="steel")
    ground = sarcl.Scene.from_heights(
        [-20, 0, 20], [-20, 20], np.ones((2, 3)), material=[[clay, "wet soil"]], point_roughness=0.02
    )
    wanted = ground + shapes.box((2, 2, 3), rotation=0.5, material=steel).on(ground, 10, -5)
    wanted = wanted + shapes.cone(2, 4, sections=12, material=0.3).on(wanted, -10, 5, depth=0.5)
    same(scene, wanted)
    assert scene.bounds[1, 2] == 4.5 and {m.name for m in scene.materials} == {"clay", "wet soil", "steel", "metal"}


def test_tables_and_scenes_come_back_from_their_text():
    scenario = loads(TEXT)
    again = loads(scenario.dumps())
    assert again.tables == scenario.tables
    same(again.build_scene(), scenario.build_scene())
    made = Scenario(scene=scenario.build_scene())
    back = loads(made.dumps())
    assert back.tables == made.tables
    same(back.build_scene(), scenario.build_scene())


def test_materials_of_a_scene_get_names_of_their_own():
    triangle = np.eye(3)[None]
    kinds = [
        sarcl.Material(3), sarcl.Material(4), sarcl.Material(5, name="x"), sarcl.Material(6, name="x"),
        sarcl.Material(7, name="metal"), sarcl.Material(3 - 0.05j, 0.01), METAL, MATERIALS["sand"],
        sarcl.Material(3, np.inf, diagram="cos2"),
    ]  # fmt: skip
    scene = sarcl.Scene.facets(triangle, material=kinds[0])
    for kind in kinds[1:]:
        scene = scene + sarcl.Scene.facets(triangle, material=kind)
    made = Scenario(scene=scene)
    assert len(made.materials) == 8 and "metal" not in made.materials
    back = loads(made.dumps()).build_scene()
    for m, kind in zip((back.materials[i] for i in back.material), kinds, strict=True):
        assert m == sarcl.Material(
            kind.eps_r, kind.conductivity, kind.height, kind.diagram, kind.width, kind.reflectivity, m.name
        )


def test_materials_may_be_given_as_materials():
    clay = sarcl.Material(9, 0.4)
    scenario = Scenario(
        materials={"clay": clay},
        scene={"facets": [{"triangles": np.eye(3)[None], "material": "clay"}]},
    )
    assert scenario.build_scene().materials == (sarcl.Material(9, 0.4, name="clay"),)
    assert loads(scenario.dumps()).tables == scenario.tables


def test_parts_of_a_mesh_and_files_beside_the_scenario(tmp_path):
    scene = trimesh.Scene()
    scene.add_geometry(trimesh.creation.box((1, 1, 1)), geom_name="body", node_name="body")
    scene.add_geometry(trimesh.creation.box((1, 1, 1)), geom_name="pane", node_name="pane")
    scene.export(tmp_path / "car.glb")
    (tmp_path / "a.toml").write_text(
        "[materials.rubber]\neps_r = 3\n"
        '[[scene.from_mesh]]\nfile = "car.glb"\nscale = 2\nrepair = false\n'
        'material = {pane = "rubber", "*" = "metal"}\n'
    )
    scenario = load(tmp_path / "a.toml")
    built = scenario.build_scene()
    assert {m.name for m in built.materials} == {"metal", "rubber"} and len(built.triangles) == 24
    scenario.save(tmp_path / "b.toml")
    same(load(tmp_path / "b.toml").build_scene(), built)


def test_an_elevation_model_and_a_geoid_beside_the_scenario(tmp_path):
    rasterio = pytest.importorskip("rasterio", reason="no rasterio: pip install sarcl[maps]")
    for name, z, step in (("dem", np.zeros((3, 4), "f4"), 0.001), ("geoid", np.full((4, 4), 48.0), 0.1)):
        with rasterio.open(
            tmp_path / f"{name}.tif", "w", driver="GTiff", height=z.shape[0], width=z.shape[1], count=1, dtype=z.dtype,
            crs="EPSG:4326", transform=rasterio.Affine(step, 0, 12 - step, 0, -step, 42 + step),
        ) as file:  # fmt: skip
            file.write(z, 1)
    (tmp_path / "a.toml").write_text(
        '[[scene.from_dem]]\nfile = "dem.tif"\nheights = "EGM96"\ngeoid = "geoid.tif"\nmaterial = "dry soil"\n'
        "[[scene.box]]\nsize = [1, 1, 1]\non = [0, 0]\n"
    )
    scene = load(tmp_path / "a.toml").build_scene()
    assert len(scene.triangles) == 12 + 12 and scene.bounds[1, 2] == pytest.approx(49, abs=0.01)
    assert scene.materials[0].name == "dry soil"


WRONG = {
    "bad material": (
        "[materials.x]\neps_r = 0.5\n[[scene.box]]\nsize = [1, 1, 1]\n",
        r"^f\.toml:2: \[materials\.x\] eps_r is 0.5",
    ),
    "gain": (
        "[materials.x]\neps_r = [3, 0.5]\n[[scene.box]]\nsize = [1, 1, 1]\n",
        r"^f\.toml:2: \[materials\.x\] eps_r is 3\+0.5j, whose positive imaginary part",
    ),
    "permittivity of three numbers": (
        "[materials.x]\neps_r = [3, 0.5, 1]\n[[scene.box]]\nsize = [1, 1, 1]\n",
        r"^f\.toml:2: \[materials\.x\] eps_r is \[3, 0.5, 1\]; give a number, or with losses a pair \[real, imag",
    ),
    "unknown key of a material": (
        "[materials.x]\nepsr = 5\n",
        r"^f\.toml:2: \[materials\.x\] unknown key 'epsr'; did you mean 'eps_r'",
    ),
    "name of a material": ("[materials.x]\nname = 'y'\n", r"^f\.toml:2: \[materials\.x\] unknown key 'name'"),
    "no table of a material": ("[materials]\nx = 5\n", r"^f\.toml:2: \[materials\] x is 5, wanted a table"),
    "no tables of materials": ("materials = 5\n", r"^f\.toml:1: materials is 5, wanted a table"),
    "material not known": (
        "[[scene.box]]\nsize = [1, 1, 1]\nmaterial = 'clay'\n",
        r"^f\.toml:3: \[\[scene\.box\]\] material is 'clay'",
    ),
    "parts of a box": (
        "[[scene.box]]\nsize = [1, 1, 1]\nmaterial = {a = 'metal'}\n",
        r"^f\.toml:3: .* material is a table, wanted",
    ),
    "nothing to stand on": (
        "[[scene.box]]\nsize = [1, 1, 1]\non = [0, 0]\n",
        r"^f\.toml:3: .* on has no ground: put the table",
    ),
    "beside the ground": (
        "[[scene.plate]]\nsize = [1, 1]\n[[scene.box]]\nsize = [1, 1, 1]\non = [9, 0]\n",
        r"^f\.toml:\d: \[\[scene\.box\]\] no facet lies at x 9, y 0 m",
    ),
    "one number": (
        "[[scene.plate]]\nsize = [1, 1]\n[[scene.box]]\nsize = [1, 1, 1]\non = [9]\n",
        r"^f\.toml:5: .* on is \[9\]; give \[x, y\], m, or \[x, y, depth\]",
    ),
    "ground on ground": (
        "[[scene.from_heights]]\nx = [0, 1]\ny = [0, 1]\nz = [[0, 0], [0, 0]]\non = [0, 0]\n",
        "unknown key 'on'",
    ),
    "unknown shape": ("[[scene.cube]]\nsize = 3\n", "unknown table 'cube'"),
    "unknown key of a shape": (
        "[[scene.cone]]\nradius = 1\nheight = 1\nsize = 3\n",
        r"^f\.toml:4: .* unknown key 'size'",
    ),
    "key of a shape left out": ("[[scene.cone]]\nradius = 1\n", "lacks the key 'height'; it needs radius, height"),
}


@pytest.mark.parametrize("name", WRONG)
def test_mistakes_name_the_line_and_the_table(name):
    text, message = WRONG[name]
    with pytest.raises(ValueError, match=message):
        loads(text, name="f.toml").build_scene()

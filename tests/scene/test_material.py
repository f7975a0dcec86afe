"""Materials: permittivity and roughness, refusals, and the names in the table."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad

import sarcl
from sarcl.scene.material import DIAGRAMS, MATERIALS, METAL, Material
from sarcl.scene.material_arguments import merge, resolve

EPS0 = 8.8541878128e-12
TOLERANCE = {"float64": 1e-12, "three figures": 5e-3}  # the table is written to three figures


def test_a_material_alone_is_a_perfect_conductor():
    assert sarcl.Material().conducting and sarcl.Material().permittivity(1e10) == np.inf
    assert sarcl.Material(diagram="cos").conducting
    assert not sarcl.Material(4).conducting and sarcl.Material(4).conductivity == 0
    assert sarcl.Material(conductivity=1).eps_r == 1


def test_the_permittivity_is_that_of_the_formula_and_decays():
    m = sarcl.Material(eps_r=5.24, conductivity=0.28)
    f = np.array([1e9, 1e10])
    wanted = 5.24 - 1j * 0.28 / (2 * np.pi * f * EPS0)
    assert np.abs(m.permittivity(f) / wanted - 1).max() <= TOLERANCE["float64"]
    assert m.permittivity(1e10) == m.permittivity(f)[1] and m.permittivity(1e10).imag < 0
    assert (sarcl.Material().permittivity(f) == np.inf).all()
    with pytest.raises(ValueError, match="frequency reaches 0 Hz"):
        m.permittivity([0, 1e9])


def test_a_complex_permittivity_is_the_same_at_all_frequencies_and_adds_to_the_conductivity():
    f = np.array([1e9, 1e10])
    assert np.array_equal(sarcl.Material(3 - 0.05j).permittivity(f), [3 - 0.05j, 3 - 0.05j])
    assert sarcl.Material(np.complex64(3)) == sarcl.Material(3) and isinstance(sarcl.Material(3 + 0j).eps_r, float)
    both, conducting = sarcl.Material(3 - 0.05j, conductivity=0.1), sarcl.Material(3, conductivity=0.1)
    assert np.allclose(both.permittivity(f), conducting.permittivity(f) - 0.05j, rtol=TOLERANCE["float64"])
    assert sarcl.Material(3 - 0.05j, conductivity=np.inf).conducting and len({both, conducting}) == 2


def test_roughness_is_none_without_a_diagram_and_total_with_one():
    for diagram in DIAGRAMS:
        width = 0.3 if diagram == "exp" else 0
        wanted = 0 if diagram in ("smooth", "sinc") else np.inf
        assert sarcl.Material(3, diagram=diagram, width=width).height == wanted
        assert sarcl.Material(3, height=0.01, diagram=diagram, width=width).height == 0.01


@pytest.mark.parametrize("width", [1e-6, 1e-3, 0.2, 1.0, 50.0])
def test_the_solid_angle_of_a_lobe_is_the_integral_of_its_power(width):
    def integral(material, end):
        return quad(lambda d: 2 * np.pi * material.lobe(d) * np.cos(d) * np.sin(d), 0, end, epsabs=0)[0]

    lobe = Material(diagram="exp", width=width)
    assert lobe.solid_angle == pytest.approx(integral(lobe, min(np.pi / 2, 8 * width)), rel=1e-9)
    for diagram in set(DIAGRAMS) - {"smooth", "sinc", "exp"}:
        material = Material(diagram=diagram)
        assert material.solid_angle == pytest.approx(integral(material, np.pi / 2), rel=1e-12)
    assert Material(diagram="sinc", height=0.01).solid_angle == Material().solid_angle == 1


def test_equal_materials_are_one_key():
    assert {sarcl.Material(4.0, 0.1): 1}[sarcl.Material(4, 0.1)] == 1
    with pytest.raises(AttributeError):
        METAL.eps_r = 2


nan, inf = float("nan"), float("inf")
BAD = {
    "less than vacuum": (dict(eps_r=0.9), "eps_r is 0.9; a relative permittivity is at least 1"),
    "negative permittivity": (dict(eps_r=-3), "eps_r is -3"),
    "permittivity nan": (dict(eps_r=nan), "eps_r is nan; it must be finite"),
    "permittivity infinite": (dict(eps_r=inf), "eps_r is inf; it must be finite"),
    "gain by permittivity": (dict(eps_r=4 + 1j), "eps_r is 4\\+1j, whose positive imaginary part .* give 4-1j"),
    "lossy permittivity below vacuum": (dict(eps_r=0.5 - 1j), "eps_r is 0.5-1j; a relative permittivity is at least 1"),
    "complex permittivity nan": (dict(eps_r=complex(nan, -1)), "eps_r is nan-1j; it must be finite"),
    "permittivities": (dict(eps_r=[4 - 1j]), "eps_r must be a number"),
    "negative conductivity": (dict(eps_r=4, conductivity=-1), "conductivity is -1 S/m; it cannot be negative"),
    "conductivity nan": (dict(eps_r=4, conductivity=nan), "conductivity is nan"),
    "negative height": (dict(eps_r=4, height=-0.01), "height is -0.01 m; it cannot be negative"),
    "height nan": (dict(eps_r=4, height=nan), "height is nan"),
    "nothing left": (dict(eps_r=4, height=inf), "height is inf with diagram 'smooth': nothing would be reflected"),
    "unknown diagram": (dict(eps_r=4, diagram="lambert"), "diagram is 'lambert'; choose one of 'smooth', 'isotropic'"),
    "exp of no width": (dict(eps_r=4, diagram="exp"), "'exp' needs a width greater than 0"),
    "width of no use": (dict(eps_r=4, diagram="cos", width=0.1), "others take none"),
    "negative width": (dict(eps_r=4, diagram="exp", width=-0.1), "width is -0.1 rad; it cannot be negative"),
    "gain": (dict(eps_r=4, reflectivity=1.1), "reflectivity is 1.1; .*more would be gain"),
    "negative reflectivity": (dict(eps_r=4, reflectivity=-1), "reflectivity is -1; it cannot be negative"),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_materials_that_cannot_be_say_why(name):
    given, message = BAD[name]
    with pytest.raises(ValueError, match=message):
        sarcl.Material(**given)


# the table


@pytest.mark.parametrize(
    "name, a, b, c, d",
    [  # ITU-R P.2040-3, table 3: eps_r = a f^b, conductivity = c f^d, f in GHz
        ("concrete", 5.24, 0, 0.0462, 0.7822),
        ("brick", 3.91, 0, 0.0238, 0.16),
        ("marble", 7.074, 0, 0.0055, 0.9262),
        ("plasterboard", 2.73, 0, 0.0085, 0.9395),
        ("wood", 1.99, 0, 0.0047, 1.0718),
        ("glass", 6.31, 0, 0.0036, 1.3394),
        ("dry soil", 3, 0, 0.00015, 2.52),
        ("moist soil", 15, -0.1, 0.035, 1.63),
        ("wet soil", 30, -0.4, 0.15, 1.30),
    ],
)
def test_building_materials_and_soils_follow_the_recommendation(name, a, b, c, d):
    m = MATERIALS[name]
    assert m.name == name
    f = np.array([1.0, 5.405, 9.6, 10.0])  # GHz
    wanted = a * f**b - 1j * c * f**d / (2 * np.pi * f * 1e9 * EPS0)
    assert m.permittivity(f * 1e9) == pytest.approx(wanted, rel=TOLERANCE["three figures"])
    assert m.at(5.405e9).permittivity(5.405e9) == pytest.approx(wanted[1], rel=TOLERANCE["three figures"])
    assert m.at(5.405e9).exponents == (0, 0) and m.disperses


def test_medium_dry_ground_at_c_band_is_that_of_the_recommendation():
    assert sarcl.material.itu("medium dry ground").permittivity(5.405e9) == pytest.approx(12.671 - 1.821j, abs=5e-4)


def test_a_frequency_outside_what_was_measured_is_told():
    with pytest.warns(
        sarcl.SarclWarning, match=r"wet ground is known from 1 to 10 GHz, and is taken at 35 GHz; give a"
    ):
        sarcl.material.itu("wet ground").permittivity([9e9, 35e9])
    with pytest.raises(ValueError, match=r"name is 'snow'.*'concrete'"):
        sarcl.material.itu("snow")
    with pytest.raises(ValueError, match=r"band is 2e\+09 to 1e\+09 Hz; give the lower frequency first"):
        sarcl.Material(3.0, band=(2e9, 1e9))
    assert sarcl.Material(3.0, 0.1, exponents=(-0.1, 1)).permittivity(1e10).real == pytest.approx(3 * 10**-0.1)


def double_debye(t, s, f):
    """Water of t degrees Celsius and s g/kg at f GHz: Meissner and Wentz 2004, tables."""
    e_s = (3.70886e4 - 82.168 * t) / (421.854 + t)
    e_1 = 5.7230 + 2.2379e-2 * t - 7.1237e-4 * t**2
    f_1 = (45 + t) / (5.0478 - 7.0315e-2 * t + 6.0059e-4 * t**2)
    e_i = 3.6143 + 2.8841e-2 * t
    f_2 = (45 + t) / (0.13652 + 1.4825e-3 * t + 2.4166e-4 * t**2)
    e_s *= np.exp(-3.56417e-3 * s + 4.74868e-6 * s**2 + 1.15574e-5 * t * s)
    f_1 *= 1 + s * (2.39357e-3 - 3.13530e-5 * t + 2.52477e-7 * t**2)
    e_1 *= np.exp(-6.28908e-3 * s + 1.76032e-4 * s**2 - 9.22144e-5 * t * s)
    f_2 *= 1 + s * (-1.99723e-2 + 1.81176e-4 * t)
    e_i *= 1 + s * (-2.04265e-3 + 1.57883e-4 * t)
    sigma_35 = 2.903602 + 8.607e-2 * t + 4.738817e-4 * t**2 - 2.991e-6 * t**3 + 4.3047e-9 * t**4
    r_15 = s * (37.5109 + 5.45216 * s + 1.4409e-2 * s**2) / (1004.75 + 182.283 * s + s**2)
    a_0 = (6.9431 + 3.2841 * s - 9.9486e-2 * s**2) / (84.85 + 69.024 * s + s**2)
    sigma = sigma_35 * r_15 * (1 + (t - 15) * a_0 / (49.843 - 0.2276 * s + 0.198e-2 * s**2 + t))
    eps = (e_s - e_1) / (1 + 1j * f / f_1) + (e_1 - e_i) / (1 + 1j * f / f_2) + e_i
    return eps - 1j * sigma / (2 * np.pi * f * 1e9 * EPS0)


@pytest.mark.parametrize("name, salt", [("water", 0), ("sea water", 35)])
def test_water_is_that_of_the_double_debye_formula_at_10_ghz(name, salt):
    assert MATERIALS[name].permittivity(1e10) == pytest.approx(
        double_debye(20, salt, 10), rel=TOLERANCE["three figures"]
    )


def test_every_material_of_the_table_reflects_at_normal_incidence():
    for name, m in MATERIALS.items():
        if not m.conducting:
            n = np.sqrt(m.permittivity(1e10))
            assert 0.05 < abs((1 - n) / (1 + n)) < 0.9, name


# words for materials


def test_a_name_a_material_and_a_number():
    index, factor, table = resolve("concrete", None, (2, 3))
    assert table == (MATERIALS["concrete"],) and (index == 0).all() and (factor == 1).all() and index.shape == (2, 3)
    index, factor, table = resolve(0.3, None, (4,))
    assert table == (METAL,) and (factor == 0.3).all() and factor.shape == (4,)
    painted = sarcl.Material(4, reflectivity=0.5, name="painted")
    index, factor, table = resolve(painted, None, (1,))
    assert table == (sarcl.Material(4, name="painted"),) and factor == [0.5]


def test_arrays_of_names_numbers_and_both():
    index, factor, table = resolve([["metal", "sand"], ["sand", "metal"]], None, (2, 2))
    assert [[table[i].name for i in row] for row in index] == [["metal", "sand"], ["sand", "metal"]]
    index, factor, table = resolve(np.array([0.1, 0.2]), None, (2,))
    assert table == (METAL,) and (factor == [0.1, 0.2]).all()
    mine = sarcl.Material(7)
    index, factor, table = resolve(["sand", 0.25, mine, "sand"], None, (4,))
    assert [table[i] for i in index] == [MATERIALS["sand"], METAL, mine, MATERIALS["sand"]]
    assert (factor == [1, 0.25, 1, 1]).all() and index.dtype == np.int32


def test_places_and_names_in_a_list_of_ones_own():
    mine = sarcl.Material(7, name="clay")
    index, factor, table = resolve([[0, 2, 1]], ["metal", 0.25, mine], (1, 3))
    assert [table[i] for i in index[0]] == [METAL, mine, METAL] and (factor == [[1, 1, 0.25]]).all()
    index, _, table = resolve(["clay", "sand"], [mine], (2,))
    assert [table[i] for i in index] == [mine, MATERIALS["sand"]]


def test_the_table_is_the_users_to_extend(monkeypatch):
    monkeypatch.setitem(MATERIALS, "snow", sarcl.Material(1.5))
    assert resolve("snow", None, (1,))[2] == (sarcl.Material(1.5),)


def test_tables_merge_without_repeats():
    a, b, c = sarcl.Material(2), sarcl.Material(3), sarcl.Material(4)
    table, places = merge([(a, b), (c, b, a)])
    assert table == (a, b, c) and [list(p) for p in places] == [[0, 1], [2, 1, 0]]


UNKNOWN = {
    "unknown name": (("moon", None, (1,)), "material is 'moon'; known are 'metal', .*sarcl.Material"),
    "unknown name in a list": ((["sand", "moon"], None, (2,)), "material is 'moon'"),
    "other shape": ((["sand", "sand"], None, (3,)), r"material has shape \(2,\), wanted one for all or \(3,\)"),
    "place of nothing": (([0, 1], None, (2,)), r"whole numbers; give the materials=\[...\]"),
    "place too far": (([0, 2], ["sand", "metal"], (2,)), "material holds 2; .* 0 to 1"),
    "place below": (([0, -1], ["sand", "metal"], (2,)), "material holds -1"),
    "no list": ((0, "sand", (1,)), "materials is 'sand'; give a list"),
    "empty list": ((0, [], (1,)), r"materials is \[\]"),
    "one too bright": ((np.array([0.5, 1.5]), None, (2,)), "material is 1.5; an amplitude reflectivity lies between"),
    "one nan": ((np.array([0.5, np.nan]), None, (2,)), r"material\[1\] is nan"),
    "table of parts": (({"a": "metal"}, None, (1,)), "material is {'a': 'metal'}; known are"),
    "nothing": ((None, None, (1,)), "material must be a number, got None"),
    "bool": ((True, None, (1,)), "material must be a number, got True"),
}  # fmt: skip


@pytest.mark.parametrize("name", UNKNOWN)
def test_what_names_no_material_is_refused(name):
    given, message = UNKNOWN[name]
    with pytest.raises(ValueError, match=message):
        resolve(*given)

"""Materials of facets: permittivity, conductivity, and roughness finer than a facet."""

from __future__ import annotations

import functools
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base import validation
from ..base.errors import warn
from ..base.text import unknown
from ..io import entry_points

VACUUM_PERMITTIVITY = 8.8541878128e-12  # F/m
Diagram = Literal["smooth", "isotropic", "cos", "cos2", "exp", "sinc"]
DIAGRAMS = ("smooth", "isotropic", "cos", "cos2", "exp", "sinc")
COHERENT = ("smooth", "sinc")  # diagrams of a coherent reflection, like that of a mirror of the facet's size


@dataclass(frozen=True)
class Material:
    """A homogeneous half space under a surface that may be rough below the size of a facet; or a thin sheet.

    eps_r         relative permittivity eps' - j eps'': eps' at least 1, eps'' at least 0
    conductivity  S/m, whose losses add to eps''; inf is a perfect conductor
    exponents     (b, d): both are those at 1 GHz, and at f GHz eps_r f^b and conductivity f^d. Default: constants
    band          Hz (2,): where these were measured; echoes at other frequencies warn
    height        rms height of the roughness finer than a facet, m: the coherent reflection falls by
                  exp(-(q.n height)^2/2); inf: there is none. Default 0, with a diagram inf
    diagram       re-irradiation of the incoherent part, d the angle between the normal and the bisector of the two
                  lines of sight: "isotropic", "cos", "cos2" (cos^2 d), "exp" (exp(-(d/width)^2)). "smooth", alias
                  "sinc", has no incoherent part, only the deterministic lobe of a flat facet
    width         rad, angle d at which "exp" is 1/e
    reflectivity  factor on the amplitude, 0 to 1
    name          for messages and scenario files
    thickness     m, of a smooth sheet with its middle in the facets' plane: it reflects at both of its sides and lets
                  waves through. For open facets that reflect from both sides; default 0, a half space
    scattering    name of a scattering model that an installed package adds, in place of Fresnel's coefficients: for
                  `echo` and `rcs` of smooth facets, in float64 (docs/developers/extensions.md); "": none

    `Material()` is a perfect conductor; a real eps_r alone gives a lossless dielectric. ValueError for impossible
    values.
    Source: Franceschetti et al. 1992 (SARAS), eq. (11) and appendix.

    >>> wet = sarcl.Material(eps_r=15 - 3j, height=0.004, diagram="cos")
    >>> field = sarcl.Scene.from_heights([0, 5, 10], [0, 5, 10], np.zeros((3, 3)), material=wet)
    >>> field.materials[0].eps_r
    (15-3j)
    >>> salty = sarcl.Material(eps_r=15, conductivity=0.1)
    >>> np.round(salty.permittivity([1e9, 10e9]), 2)
    array([15.-1.8j , 15.-0.18j])
    >>> salty.at(1e9).conductivity, float(sarcl.Material(height=0.004, diagram="cos").lobe(0.0))
    (0.1, 1.0)
    """

    eps_r: complex = None  # type: ignore[assignment]
    conductivity: float = None  # type: ignore[assignment]
    height: float = None  # type: ignore[assignment]
    diagram: Diagram = "smooth"
    width: float = 0.0
    reflectivity: float = 1.0
    name: str = ""
    thickness: float = 0.0
    exponents: tuple[float, float] = (0.0, 0.0)
    band: tuple[float, float] | None = None
    scattering: str = ""

    def __post_init__(self) -> None:
        validation.choice("diagram", self.diagram, DIAGRAMS)
        conducting = self.eps_r is None
        default = {
            "eps_r": 1.0,
            "conductivity": np.inf if conducting else 0.0,
            "height": 0.0 if self.diagram in COHERENT else np.inf,
            "width": 0.0,
            "reflectivity": 1.0,
            "thickness": 0.0,
        }
        for name in ("eps_r", "conductivity", "height", "width", "reflectivity", "thickness"):
            value = getattr(self, name)
            if name == "eps_r" and value is not None and np.iscomplexobj(value):
                value = _lossy(value)
            else:
                value = default[name] if value is None else _number(name, value, name in ("conductivity", "height"))
            object.__setattr__(self, name, value)
        object.__setattr__(self, "exponents", _two("exponents", self.exponents))
        if self.band is not None:
            low, high = _two("band", self.band)
            if not 0 < low < high:
                raise ValueError(f"band is {low:g} to {high:g} Hz; give the lower frequency first, both greater than 0")
            object.__setattr__(self, "band", (low, high))
        if not np.real(self.eps_r) >= 1:
            raise ValueError(
                f"eps_r is {self.eps_r:g}; a relative permittivity is at least 1 (vacuum), with losses as a negative "
                "imaginary part or in conductivity"
            )
        for name, unit in (
            ("conductivity", "S/m"),
            ("height", "m"),
            ("width", "rad"),
            ("reflectivity", ""),
            ("thickness", "m"),
        ):
            if not getattr(self, name) >= 0:
                raise ValueError(f"{name} is {getattr(self, name):g} {unit}".rstrip() + "; it cannot be negative")
        if self.reflectivity > 1:
            raise ValueError(
                f"reflectivity is {self.reflectivity:g}; an amplitude factor lies between 0 and 1: more would be gain"
            )
        if self.diagram in COHERENT and self.height == np.inf:
            raise ValueError(
                f"height is inf with diagram {self.diagram!r}: nothing would be reflected; take a diagram such as "
                "'isotropic' for incoherent reflection"
            )
        if (self.diagram == "exp") != (self.width > 0):
            raise ValueError(
                f"width is {self.width:g} rad with diagram {self.diagram!r}; 'exp' needs a width greater than 0, "
                "others take none"
            )
        if self.thickness and (self.conducting or self.height or self.diagram not in COHERENT):
            raise ValueError(
                f"thickness is {self.thickness:g} m of a perfect conductor or a rough surface; give it to smooth "
                "dielectrics, and to metals a conductivity"
            )
        self._check_scattering()

    def _check_scattering(self) -> None:
        """TypeError or ValueError where a name is no string, or none of a model that goes with the rest."""
        for name in ("name", "scattering"):
            if not isinstance(getattr(self, name), str):
                raise TypeError(f"{name} is a {type(getattr(self, name)).__name__}; give a string")
        if self.scattering and self.scattering not in (known := entry_points.names("scattering")):
            raise ValueError(unknown(self.scattering, known, "scattering model of an installed package"))
        if self.scattering and (self.thickness or self.height or self.diagram not in COHERENT):
            raise ValueError(f"scattering is {self.scattering!r}: a model is that of smooth facets, without thickness")

    @property
    def conducting(self) -> bool:
        """True for a perfect conductor."""
        return self.conductivity == np.inf

    def lobe(self, delta: ArrayLike) -> NDArray[np.float64]:
        """The diagram D at angles delta between normal and bisector, rad (...); 0 for smooth materials."""
        delta = validation.values("delta", delta)
        with np.errstate(invalid="ignore", over="ignore"):  # infinite angles have no direction: NaN, as of NaN
            cosine = np.maximum(np.cos(delta), 0)
            if self.diagram == "exp":
                return np.exp(-((delta / self.width) ** 2))
        return {"isotropic": 1 + 0 * cosine, "cos": cosine, "cos2": cosine**2}.get(self.diagram, 0 * cosine)

    @property
    def solid_angle(self) -> float:
        """Integral of D cos over the hemisphere, sr: pi for an isotropic diagram; 1 where there is none."""
        return 1.0 if self.diagram in COHERENT else _solid_angle(self)

    def permittivity(self, frequency: ArrayLike) -> NDArray[np.complex128]:
        """Complex relative permittivity eps_r - j conductivity/(2 pi f eps0) at `frequency`, Hz, of its shape.

        eps_r may be complex itself: both losses add. The imaginary part is negative, because fields vary as
        exp(+j 2 pi f t). inf for a perfect conductor. A warning names a frequency outside `band`.
        """
        frequency = validation.values("frequency", frequency)
        if not (frequency > 0).all():
            raise ValueError(f"frequency reaches {frequency.min():g} Hz; it must be greater than 0")
        values: np.ndarray
        if self.conducting:
            values = np.full(frequency.shape, np.inf, np.complex128)
        else:
            power, power_of_losses = self.exponents
            gigahertz = frequency / 1e9
            losses = self.conductivity * gigahertz**power_of_losses / (2 * np.pi * VACUUM_PERMITTIVITY * frequency)
            values = self.eps_r * gigahertz**power - 1j * losses
            if frequency.size:
                self._warn_outside(float(frequency.min()), float(frequency.max()))
        return np.asarray(values)[()]

    def _warn_outside(self, low: float, high: float) -> None:
        """Warn of frequencies outside `band`."""
        if self.band is not None and not self.band[0] <= low <= high <= self.band[1]:
            warn(
                f"the permittivity of {self.name or 'a material'} is known from {self.band[0] / 1e9:g} to "
                f"{self.band[1] / 1e9:g} GHz, and is taken at {(low if low < self.band[0] else high) / 1e9:.4g} GHz; "
                "give a Material that was measured there",
                f"band of {self.name}",
            )

    def at(self, frequency: float) -> Material:
        """The material with the permittivity that it has at `frequency`, Hz, as constants."""
        if self.exponents == (0.0, 0.0) or self.conducting:
            return self
        powers = [(frequency / 1e9) ** power for power in self.exponents]
        constants = {"eps_r": self.eps_r * powers[0], "conductivity": self.conductivity * powers[1]}
        return replace(self, **constants, exponents=(0.0, 0.0))

    @property
    def disperses(self) -> bool:
        """Whether the permittivity depends on frequency."""
        return not self.conducting and (self.conductivity > 0 or self.exponents[0] != 0)


@functools.lru_cache(maxsize=1024)
def _solid_angle(material: Material) -> float:
    """`Material.solid_angle` by Gauss's rule, to 1e-13; cached, because it is needed for every pulse and frequency."""
    nodes, weights = np.polynomial.legendre.leggauss(48)
    end = min(np.pi / 2, 7 * (material.width or np.inf))  # for larger angles exp(-(d/width)^2) is below 1e-21
    delta = (nodes + 1) * end / 2
    return float(np.pi * end / 2 * (weights * material.lobe(delta) * np.sin(2 * delta)).sum())


def _number(name: str, value: object, inf: bool) -> float:
    """A float, which may be infinite where `inf` is True; an error names the argument."""
    if inf and isinstance(value, (float, np.floating)) and value == np.inf:
        return np.inf
    return validation.number(name, value)


def _two(name: str, values: object) -> tuple[float, float]:
    """Two finite numbers; an error names the argument."""
    first, second = validation.pair(name, values)
    return _number(f"{name}[0]", first, False), _number(f"{name}[1]", second, False)


def _lossy(value: complex) -> complex:
    """A complex eps_r; a float where its imaginary part is 0."""
    if np.ndim(value) or np.ma.is_masked(value):
        raise ValueError(f"eps_r must be a number, got {value!r:.80}")
    eps_r = complex(value)
    if not np.isfinite(eps_r):
        raise ValueError(f"eps_r is {eps_r:g}; it must be finite")
    if eps_r.imag > 0:
        raise ValueError(
            f"eps_r is {eps_r:g}, whose positive imaginary part would be gain: fields vary as exp(+j 2 pi f t), and "
            f"losses are negative; give {eps_r.conjugate():g}"
        )
    return eps_r if eps_r.imag else eps_r.real


METAL = Material(name="metal")
# ITU-R P.2040-3, table 3: a, b, c, d of eps_r = a f^b and conductivity = c f^d S/m, f in GHz, and where they hold, GHz
_ITU = {
    "concrete": (5.24, 0.0, 0.0462, 0.7822, 1, 100),
    "brick": (3.91, 0.0, 0.0238, 0.16, 1, 40),
    "plasterboard": (2.73, 0.0, 0.0085, 0.9395, 1, 100),
    "wood": (1.99, 0.0, 0.0047, 1.0718, 0.001, 100),
    "glass": (6.31, 0.0, 0.0036, 1.3394, 0.1, 100),
    "ceiling board": (1.48, 0.0, 0.0011, 1.0750, 1, 100),
    "chipboard": (2.58, 0.0, 0.0217, 0.78, 1, 100),
    "plywood": (2.71, 0.0, 0.33, 0.0, 1, 40),
    "marble": (7.074, 0.0, 0.0055, 0.9262, 1, 60),
    "very dry ground": (3.0, 0.0, 0.00015, 2.52, 1, 10),
    "medium dry ground": (15.0, -0.1, 0.035, 1.63, 1, 10),
    "wet ground": (30.0, -0.4, 0.15, 1.30, 1, 10),
}


def itu(name: str) -> Material:
    """A building material or ground of ITU-R P.2040-3, table 3, whose permittivity follows the frequency.

    name  "concrete", "brick", "plasterboard", "wood", "glass", "ceiling board", "chipboard", "plywood", "marble",
          "very dry ground", "medium dry ground" or "wet ground"
    ValueError for another name.

    >>> round(float(sarcl.material.itu("concrete").permittivity(9.6e9).real), 2)
    5.24
    """
    a, b, c, d, low, high = _ITU[validation.choice("name", name, tuple(_ITU))]
    return Material(a, c, exponents=(b, d), band=(low * 1e9, high * 1e9), name=name)


# docs/guide/scenes.md names the source of each. Add your own: MATERIALS["snow"] = Material(1.5).
MATERIALS: dict[str, Material] = {
    material.name: material
    for material in (
        METAL,
        *(itu(name) for name in _ITU),
        # earlier names of these grounds
        replace(itu("very dry ground"), name="dry soil"),
        replace(itu("medium dry ground"), name="moist soil"),
        replace(itu("wet ground"), name="wet soil"),
        # at 10 GHz:
        # Meissner and Wentz 2004, 2012 at 20 degrees Celsius, 0 and 35 g/kg of salt
        Material(60.7, 18.2, name="water"),
        Material(55.9, 20.6, name="sea water"),
        # von Hippel 1954: dry sandy soil, loss tangent 0.0036
        Material(2.53, 0.0051, name="sand"),
        # Olkkonen 2016 (7 to 17 GHz); loss from the depth of 13 cm at 8 GHz of Jaselskis et al. 2003
        Material(5.0, 0.046, name="asphalt"),
    )
}

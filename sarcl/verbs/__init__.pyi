# Made from the records of the verbs' options by python docs/developers/write_options.py

from collections.abc import Callable, Collection, Sequence
from typing import Literal, ParamSpec, TypedDict, TypeVar, overload

import distributed
import numpy as np
from numpy.typing import ArrayLike

from ..arrays.map_aperture import MapApertureOptions, MapKind
from ..base.forecast import Forecast
from ..base.types import PathLike, WritableArray
from ..blocks.block_options import Tile
from ..earth.elevation import ElevationModel
from ..imaging.focusing_task import BeamCone
from ..imaging.focusing_task import Skip as BackprojectSkip
from ..model.antenna import Antenna
from ..model.antenna_array import AntennaArray
from ..model.image import Image
from ..model.image_grid import ImageGrid
from ..model.phase_history import PhaseHistory
from ..model.radar import Radar
from ..model.trajectory import Trajectory
from ..model.waveform import Waveform
from ..numerics.run_options import Progress
from ..numerics.windows import Window
from ..opencl.device import DeviceChoice
from ..scene.scene import Scene
from ..simulation.echo_options import Skip as EchoSkip
from ..simulation.track_options import Polarization

_P = ParamSpec("_P")
_R = TypeVar("_R")

HOMES: dict[str, str]

class EchoKeywords(TypedDict, total=False):
    """Options of `echo`, for functions that hand them on."""

    method: Literal["auto", "direct", "factorized"]
    forward: bool
    channels: Literal["simultaneous", "separated"]
    receive: Literal["reference", "own", "all"]
    skip: bool | Collection[EchoSkip]
    edges: bool
    crease: float
    array: AntennaArray | None
    antenna: Antenna | tuple[Antenna, Antenna] | None
    radar: Radar | None
    shadows: bool
    seed: int
    max_edge: float | Literal["auto"] | None
    max_bytes: float | None
    check: bool | None
    bounces: int
    receiver: Trajectory | None
    polarization: Polarization | Literal["all"] | Sequence[Polarization]
    vertical: ArrayLike | None
    range_window: ArrayLike | None
    reference: ArrayLike | None
    compressed: bool
    out: PathLike | None
    resume: bool | None
    tile: Tile | None
    device: DeviceChoice | None
    cluster: distributed.Client | None
    tolerance: float
    progress: Progress | None

class SpectralEchoKeywords(TypedDict, total=False):
    """Options of `spectral_echo`, for functions that hand them on."""

    variant: Literal["exact", "saras"]
    ripple: bool
    receiver: Trajectory | None
    array: AntennaArray | None
    bounces: int
    range_window: ArrayLike | None
    skip: bool | Collection[Literal["zero reflectivity", "facing away", "range window"]]
    max_bytes: float | None
    tolerance: float
    check: bool | None
    antenna: Antenna | tuple[Antenna, Antenna] | None
    radar: Radar | None
    shadows: bool
    seed: int
    max_edge: float | Literal["auto"] | None
    polarization: Polarization | Literal["all"] | Sequence[Polarization]
    vertical: ArrayLike | None
    reference: ArrayLike | None
    compressed: bool
    out: PathLike | None
    resume: bool | None
    tile: Tile | None
    device: DeviceChoice | None
    cluster: distributed.Client | None
    progress: Progress | None

class FullwaveEchoKeywords(TypedDict, total=False):
    """Options of `fullwave_echo`, for functions that hand them on."""

    polarization: Polarization | Literal["all"] | Sequence[Polarization]
    range_window: ArrayLike | None
    cells: Literal["auto"] | float
    anchors: Literal["auto"] | int | Sequence[int]
    max_bytes: float | None
    out: PathLike | None
    resume: bool | None
    tile: Tile | None
    tolerance: float
    check: bool
    model_error: bool
    receiver: Trajectory | None
    vertical: ArrayLike | None
    reference: ArrayLike | None
    compressed: bool
    device: DeviceChoice | None
    cluster: distributed.Client | None
    progress: Progress | None

class BackprojectKeywords(TypedDict, total=False):
    """Options of `backproject`, for functions that hand them on."""

    method: Literal["auto", "direct", "factorized"]
    beam: BeamCone | None
    mapping: MapKind | MapApertureOptions | None
    wrap: bool
    skip: bool | Collection[BackprojectSkip]
    out: PathLike | WritableArray | None
    sum_polarizations: bool
    window: Window | None
    weights: ArrayLike | None
    resume: bool | None
    tile: Tile | None
    device: DeviceChoice | None
    cluster: distributed.Client | None
    tolerance: float
    max_bytes: float | None
    check: bool | None
    progress: Progress | None

class PolarFormatKeywords(TypedDict, total=False):
    """Options of `polar_format`, for functions that hand them on."""

    tolerance: float
    sum_polarizations: bool
    window: Window | None
    weights: ArrayLike | None
    out: PathLike | None
    max_bytes: float | None
    check: bool | None
    device: DeviceChoice | None
    progress: Progress | None

class RangeDopplerKeywords(TypedDict, total=False):
    """Options of `range_doppler`, for functions that hand them on."""

    heights: float | ElevationModel
    side: Literal["left", "right"] | None
    times: Sequence[float] | None
    ranges: Sequence[float] | None
    spacing: tuple[float | None, float | None] | None
    azimuth_beam: float | None
    doppler: Literal["geometry", "data"] | float
    near: float | None
    doppler_rate: Literal["geometry", "data"] | float
    tolerance: float
    max_bytes: float | None
    check: bool | None
    window: Window | None
    weights: ArrayLike | None
    out: PathLike | None
    device: DeviceChoice | None
    progress: Progress | None

class RcsKeywords(TypedDict, total=False):
    """Options of `rcs`, for functions that hand them on."""

    receiver: tuple[ArrayLike, ArrayLike] | None
    polarization: Polarization | Literal["all"] | Sequence[Polarization]
    forward: bool
    shadows: bool
    check: bool | None
    bounces: int
    edges: bool
    crease: float
    tolerance: float
    max_bytes: float | None
    device: DeviceChoice | None
    progress: Progress | None

@overload
def echo(
    scene: Scene,
    waveform: Waveform,
    track: Trajectory,
    *,
    method: Literal["auto", "direct", "factorized"] = "auto",
    forward: bool = False,
    channels: Literal["simultaneous", "separated"] = "simultaneous",
    receive: Literal["reference", "own", "all"] = "reference",
    skip: bool | Collection[EchoSkip] = True,
    edges: bool = False,
    crease: float = 0.35,
    array: AntennaArray | None = None,
    antenna: Antenna | tuple[Antenna, Antenna] | None = None,
    radar: Radar | None = None,
    shadows: bool = True,
    seed: int = 0,
    max_edge: float | Literal["auto"] | None = "auto",
    max_bytes: float | None = None,
    check: bool | None = None,
    bounces: int = 1,
    receiver: Trajectory | None = None,
    polarization: Polarization | Literal["all"] | Sequence[Polarization] = "HH",
    vertical: ArrayLike | None = None,
    range_window: ArrayLike | None = None,
    reference: ArrayLike | None = None,
    compressed: bool = True,
    out: PathLike | None = None,
    resume: bool | None = None,
    tile: None = None,
    device: DeviceChoice | None = None,
    cluster: distributed.Client | None = None,
    tolerance: float = 0.001,
    progress: Progress | None = None,
) -> PhaseHistory:
    """Echoes s_p(f) = sum_k a_k(p) W(f) exp(-j 2 pi f (tau_k(p) - tau_ref(p))) of every pulse, compressed. Options:
    docs/guide/options.md."""

@overload
def echo(
    scene: Scene,
    waveform: Waveform,
    track: Trajectory,
    *,
    method: Literal["auto", "direct", "factorized"] = "auto",
    forward: bool = False,
    channels: Literal["simultaneous", "separated"] = "simultaneous",
    receive: Literal["reference", "own", "all"] = "reference",
    skip: bool | Collection[EchoSkip] = True,
    edges: bool = False,
    crease: float = 0.35,
    array: AntennaArray | None = None,
    antenna: Antenna | tuple[Antenna, Antenna] | None = None,
    radar: Radar | None = None,
    shadows: bool = True,
    seed: int = 0,
    max_edge: float | Literal["auto"] | None = "auto",
    max_bytes: float | None = None,
    check: bool | None = None,
    bounces: int = 1,
    receiver: Trajectory | None = None,
    polarization: Polarization | Literal["all"] | Sequence[Polarization] = "HH",
    vertical: ArrayLike | None = None,
    range_window: ArrayLike | None = None,
    reference: ArrayLike | None = None,
    compressed: bool = True,
    out: PathLike | None = None,
    resume: bool | None = None,
    tile: Tile | None,
    device: DeviceChoice | None = None,
    cluster: distributed.Client | None = None,
    tolerance: float = 0.001,
    progress: Progress | None = None,
) -> PhaseHistory | None:
    """Echoes s_p(f) = sum_k a_k(p) W(f) exp(-j 2 pi f (tau_k(p) - tau_ref(p))) of every pulse, compressed. Options:
    docs/guide/options.md."""

@overload
def echo(
    scene: Scene,
    waveform: Waveform,
    track: list[Trajectory] | tuple[Trajectory, ...],
    *,
    method: Literal["auto", "direct", "factorized"] = "auto",
    forward: bool = False,
    channels: Literal["simultaneous", "separated"] = "simultaneous",
    receive: Literal["reference", "own", "all"] = "reference",
    skip: bool | Collection[EchoSkip] = True,
    edges: bool = False,
    crease: float = 0.35,
    array: AntennaArray | None = None,
    antenna: Antenna | tuple[Antenna, Antenna] | None = None,
    radar: Radar | None = None,
    shadows: bool = True,
    seed: int = 0,
    max_edge: float | Literal["auto"] | None = "auto",
    max_bytes: float | None = None,
    check: bool | None = None,
    bounces: int = 1,
    receiver: list[Trajectory] | tuple[Trajectory, ...] | None = None,
    polarization: Polarization | Literal["all"] | Sequence[Polarization] = "HH",
    vertical: ArrayLike | None = None,
    range_window: ArrayLike | None = None,
    reference: ArrayLike | None = None,
    compressed: bool = True,
    out: PathLike | None = None,
    resume: bool | None = None,
    tile: None = None,
    device: DeviceChoice | None = None,
    cluster: distributed.Client | None = None,
    tolerance: float = 0.001,
    progress: Progress | None = None,
) -> list[PhaseHistory]:
    """Echoes s_p(f) = sum_k a_k(p) W(f) exp(-j 2 pi f (tau_k(p) - tau_ref(p))) of every pulse, compressed. Options:
    docs/guide/options.md."""

@overload
def spectral_echo(
    scene: Scene,
    waveform: Waveform,
    track: Trajectory,
    *,
    variant: Literal["exact", "saras"] = "exact",
    ripple: bool = False,
    receiver: Trajectory | None = None,
    array: AntennaArray | None = None,
    bounces: int = 1,
    range_window: ArrayLike | None = None,
    skip: bool | Collection[Literal["zero reflectivity", "facing away", "range window"]] = True,
    max_bytes: float | None = None,
    tolerance: float = 0.01,
    check: bool | None = None,
    antenna: Antenna | tuple[Antenna, Antenna] | None = None,
    radar: Radar | None = None,
    shadows: bool = True,
    seed: int = 0,
    max_edge: float | Literal["auto"] | None = "auto",
    polarization: Polarization | Literal["all"] | Sequence[Polarization] = "HH",
    vertical: ArrayLike | None = None,
    reference: ArrayLike | None = None,
    compressed: bool = True,
    out: PathLike | None = None,
    resume: bool | None = None,
    tile: None = None,
    device: DeviceChoice | None = None,
    cluster: distributed.Client | None = None,
    progress: Progress | None = None,
) -> PhaseHistory:
    """The samples of `echo` for a straight track of evenly spaced pulses, by two-dimensional Fourier transforms.
    Options: docs/guide/options.md."""

@overload
def spectral_echo(
    scene: Scene,
    waveform: Waveform,
    track: Trajectory,
    *,
    variant: Literal["exact", "saras"] = "exact",
    ripple: bool = False,
    receiver: Trajectory | None = None,
    array: AntennaArray | None = None,
    bounces: int = 1,
    range_window: ArrayLike | None = None,
    skip: bool | Collection[Literal["zero reflectivity", "facing away", "range window"]] = True,
    max_bytes: float | None = None,
    tolerance: float = 0.01,
    check: bool | None = None,
    antenna: Antenna | tuple[Antenna, Antenna] | None = None,
    radar: Radar | None = None,
    shadows: bool = True,
    seed: int = 0,
    max_edge: float | Literal["auto"] | None = "auto",
    polarization: Polarization | Literal["all"] | Sequence[Polarization] = "HH",
    vertical: ArrayLike | None = None,
    reference: ArrayLike | None = None,
    compressed: bool = True,
    out: PathLike | None = None,
    resume: bool | None = None,
    tile: Tile | None,
    device: DeviceChoice | None = None,
    cluster: distributed.Client | None = None,
    progress: Progress | None = None,
) -> PhaseHistory | None:
    """The samples of `echo` for a straight track of evenly spaced pulses, by two-dimensional Fourier transforms.
    Options: docs/guide/options.md."""

@overload
def fullwave_echo(
    scene: Scene,
    waveform: Waveform,
    track: Trajectory,
    *,
    polarization: Polarization | Literal["all"] | Sequence[Polarization] = "HH",
    range_window: ArrayLike | None = None,
    cells: Literal["auto"] | float = "auto",
    anchors: Literal["auto"] | int | Sequence[int] = "auto",
    max_bytes: float | None = None,
    out: PathLike | None = None,
    resume: bool | None = None,
    tile: None = None,
    tolerance: float = 0.03,
    check: bool = False,
    model_error: bool = True,
    receiver: Trajectory | None = None,
    vertical: ArrayLike | None = None,
    reference: ArrayLike | None = None,
    compressed: bool = True,
    device: DeviceChoice | None = None,
    cluster: distributed.Client | None = None,
    progress: Progress | None = None,
) -> PhaseHistory:
    """Echoes of closed bodies by a solution of Maxwell's equations on a grid (FDTD): all reflections, diffraction,
    creeping waves and resonances. Options: docs/guide/options.md."""

@overload
def fullwave_echo(
    scene: Scene,
    waveform: Waveform,
    track: Trajectory,
    *,
    polarization: Polarization | Literal["all"] | Sequence[Polarization] = "HH",
    range_window: ArrayLike | None = None,
    cells: Literal["auto"] | float = "auto",
    anchors: Literal["auto"] | int | Sequence[int] = "auto",
    max_bytes: float | None = None,
    out: PathLike | None = None,
    resume: bool | None = None,
    tile: Tile | None,
    tolerance: float = 0.03,
    check: bool = False,
    model_error: bool = True,
    receiver: Trajectory | None = None,
    vertical: ArrayLike | None = None,
    reference: ArrayLike | None = None,
    compressed: bool = True,
    device: DeviceChoice | None = None,
    cluster: distributed.Client | None = None,
    progress: Progress | None = None,
) -> PhaseHistory | None:
    """Echoes of closed bodies by a solution of Maxwell's equations on a grid (FDTD): all reflections, diffraction,
    creeping waves and resonances. Options: docs/guide/options.md."""

@overload
def backproject(
    raw: PhaseHistory,
    grid: ImageGrid,
    *,
    method: Literal["auto", "direct", "factorized"] = "auto",
    beam: BeamCone | None = None,
    mapping: MapKind | MapApertureOptions | None = None,
    wrap: bool = False,
    skip: bool | Collection[BackprojectSkip] = True,
    out: PathLike | WritableArray | None = None,
    sum_polarizations: bool = False,
    window: Window | None = None,
    weights: ArrayLike | None = None,
    resume: bool | None = None,
    tile: None = None,
    device: DeviceChoice | None = None,
    cluster: distributed.Client | None = None,
    tolerance: float = 0.001,
    max_bytes: float | None = None,
    check: bool | None = None,
    progress: Progress | None = None,
) -> Image:
    """Focus echoes on a grid: I(x) = sum_p v_p(x) sum_n w_pn s_p(f_n) exp(+j 2 pi f_n (tau(x, p) - tau_ref(p))).
    Options: docs/guide/options.md."""

@overload
def backproject(
    raw: PhaseHistory,
    grid: ImageGrid,
    *,
    method: Literal["auto", "direct", "factorized"] = "auto",
    beam: BeamCone | None = None,
    mapping: MapKind | MapApertureOptions | None = None,
    wrap: bool = False,
    skip: bool | Collection[BackprojectSkip] = True,
    out: PathLike | WritableArray | None = None,
    sum_polarizations: bool = False,
    window: Window | None = None,
    weights: ArrayLike | None = None,
    resume: bool | None = None,
    tile: Tile | None,
    device: DeviceChoice | None = None,
    cluster: distributed.Client | None = None,
    tolerance: float = 0.001,
    max_bytes: float | None = None,
    check: bool | None = None,
    progress: Progress | None = None,
) -> Image | None:
    """Focus echoes on a grid: I(x) = sum_p v_p(x) sum_n w_pn s_p(f_n) exp(+j 2 pi f_n (tau(x, p) - tau_ref(p))).
    Options: docs/guide/options.md."""

def polar_format(
    raw: PhaseHistory,
    grid: ImageGrid,
    *,
    tolerance: float = 0.01,
    sum_polarizations: bool = False,
    window: Window | None = None,
    weights: ArrayLike | None = None,
    out: PathLike | None = None,
    max_bytes: float | None = None,
    check: bool | None = None,
    device: DeviceChoice | None = None,
    progress: Progress | None = None,
) -> Image:
    """Focus echoes on a plane with plane wavefronts: I(x) = sum_p sum_n w_pn s_pn exp(+j 2 pi K_pn.(x - c)).
    Options: docs/guide/options.md."""

def range_doppler(
    raw: PhaseHistory,
    *,
    heights: float | ElevationModel = 0.0,
    side: Literal["left", "right"] | None = None,
    times: Sequence[float] | None = None,
    ranges: Sequence[float] | None = None,
    spacing: tuple[float | None, float | None] | None = None,
    azimuth_beam: float | None = None,
    doppler: Literal["geometry", "data"] | float = "geometry",
    near: float | None = None,
    doppler_rate: Literal["geometry", "data"] | float = "geometry",
    tolerance: float = 0.01,
    max_bytes: float | None = None,
    check: bool | None = None,
    window: Window | None = None,
    weights: ArrayLike | None = None,
    out: PathLike | None = None,
    device: DeviceChoice | None = None,
    progress: Progress | None = None,
) -> Image:
    """Focus echoes of a near-straight, evenly sampled track on a grid of zero-Doppler times and slant ranges.
    Options: docs/guide/options.md."""

def rcs(
    scene: Scene,
    azimuth: ArrayLike,
    elevation: ArrayLike,
    frequency: ArrayLike,
    *,
    receiver: tuple[ArrayLike, ArrayLike] | None = None,
    polarization: Polarization | Literal["all"] | Sequence[Polarization] = "HH",
    forward: bool = False,
    shadows: bool = True,
    check: bool | None = None,
    bounces: int = 1,
    edges: bool = False,
    crease: float = 0.35,
    tolerance: float = 0.001,
    max_bytes: float | None = None,
    device: DeviceChoice | None = None,
    progress: Progress | None = None,
) -> np.ndarray:
    """Scattering amplitudes s of a scene for plane waves: |s|^2 is the radar cross section, m^2. Options:
    docs/guide/options.md."""

@overload
def plan(verb: Callable[_P, _R], /, *args: _P.args, **options: _P.kwargs) -> Forecast[_R]:
    """Forecast of a verb: plan(verb, *args, **options) with the arguments of `verb(...)`, before any work."""

@overload
def plan(
    raw: PhaseHistory,
    grid: ImageGrid,
    *,
    method: Literal["auto", "direct", "factorized"] = "auto",
    beam: BeamCone | None = None,
    mapping: MapKind | MapApertureOptions | None = None,
    wrap: bool = False,
    skip: bool | Collection[BackprojectSkip] = True,
    out: PathLike | WritableArray | None = None,
    sum_polarizations: bool = False,
    window: Window | None = None,
    weights: ArrayLike | None = None,
    resume: bool | None = None,
    tile: Tile | None = None,
    device: DeviceChoice | None = None,
    cluster: distributed.Client | None = None,
    tolerance: float = 0.001,
    max_bytes: float | None = None,
    check: bool | None = None,
    progress: Progress | None = None,
) -> Forecast[Image]:
    """Forecast of a verb: plan(verb, *args, **options) with the arguments of `verb(...)`, before any work."""

"""sarcl: synthetic-aperture-radar echoes and images on any OpenCL device.

Two equations carry everything::

    echo     s_p(f) = sum_k a_k(p) W(f) exp(-j 2 pi f (tau_k(p) - tau_ref(p)))
    image    I(x)   = sum_p v_p(x) sum_n s_p(f_n) exp(+j 2 pi f_n (tau(x, p) - tau_ref(p)))

    tau      (|T_p - x| + |x - R_p|)/c        Trajectory (T, R), ImageGrid and Scene (x)
    tau_ref  2 reference_range/c              PhaseHistory.reference_range
    a_k      amplitude, |a|^2 = RCS in m^2    Scene
    W        matched-filter spectrum          Waveform.matched_spectrum
    s_p      samples, one row p               PhaseHistory
    v_p      1 inside the range window        |tau - tau_ref| <= 1/(2 frequency_step)
    I        data                             Image

nouns    Waveform Trajectory Material Scene AntennaArray PhaseHistory ImageGrid Image Report Scenario
verbs    echo beam ambiguity compress map_aperture backproject polar_format autofocus measure read concatenate devices
"""

import sys
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any

# Imported on first use: `sarcl --help` must not wait for numpy, and nothing probes a device at import.
_HOME = {
    "Waveform": "model.waveform",
    "Trajectory": "model.trajectory",
    "Scene": "scene.scene",
    "Material": "scene.material",
    "Antenna": "model.antenna",
    "AntennaArray": "model.antenna_array",
    "Radar": "model.radar",
    "PhaseHistory": "model.phase_history",
    "concatenate": "model.phase_history",
    "ImageGrid": "model.image_grid",
    "Image": "model.image",
    "Report": "base.report",
    "Scenario": "scenario.scenario",
    "echo": "simulation.echo",
    "beam": "arrays.beam",
    "ambiguity": "arrays.ambiguity",
    "Ambiguity": "arrays.ambiguity",
    "compress": "imaging.compress",
    "backproject": "imaging.backproject",
    "polar_format": "imaging.polar_format.polar_format",
    "plan": "imaging.forecast",
    "Forecast": "imaging.forecast",
    "plan_echo": "simulation.echo_forecast",
    "EchoForecast": "simulation.echo_forecast",
    "add_noise": "effects.noise",
    "autofocus": "phase_correction.autofocus",
    "map_aperture": "arrays.map_aperture",
    "measure": "analysis.point_response",
    "PointResponse": "analysis.point_response",
    "read": "model.store",
    "devices": "opencl.device",
    "NoDeviceError": "opencl.device",
    "SarclWarning": "base.errors",
    "ToleranceMissed": "base.errors",
}

# Public modules, by the file that holds them.
_MODULES = {
    "shapes": "scene.shapes",
    "pointing": "model.pointing",
    "motion": "effects.motion",
    "fda": "experiments.fda.measure",
    "papers": "papers",
}

__all__ = sorted(_HOME)

if TYPE_CHECKING:
    from .analysis.point_response import PointResponse as PointResponse
    from .analysis.point_response import measure as measure
    from .arrays.ambiguity import Ambiguity as Ambiguity
    from .arrays.ambiguity import ambiguity as ambiguity
    from .arrays.beam import beam as beam
    from .arrays.map_aperture import map_aperture as map_aperture
    from .base.errors import SarclWarning as SarclWarning
    from .base.errors import ToleranceMissed as ToleranceMissed
    from .base.report import Report as Report
    from .effects.noise import add_noise as add_noise
    from .imaging.backproject import backproject as backproject
    from .imaging.compress import compress as compress
    from .imaging.forecast import Forecast as Forecast
    from .imaging.forecast import plan as plan
    from .imaging.polar_format.polar_format import polar_format as polar_format
    from .model.antenna import Antenna as Antenna
    from .model.antenna_array import AntennaArray as AntennaArray
    from .model.image import Image as Image
    from .model.image_grid import ImageGrid as ImageGrid
    from .model.phase_history import PhaseHistory as PhaseHistory
    from .model.phase_history import concatenate as concatenate
    from .model.radar import Radar as Radar
    from .model.store import read as read
    from .model.trajectory import Trajectory as Trajectory
    from .model.waveform import Waveform as Waveform
    from .opencl.device import NoDeviceError as NoDeviceError
    from .opencl.device import devices as devices
    from .phase_correction.autofocus import autofocus as autofocus
    from .scenario.scenario import Scenario as Scenario
    from .scene.material import Material as Material
    from .scene.scene import Scene as Scene
    from .simulation.echo import echo as echo
    from .simulation.echo_forecast import EchoForecast as EchoForecast
    from .simulation.echo_forecast import plan_echo as plan_echo


class _Package(ModuleType):
    """A verb and its module share a name (`sarcl.echo`): importing the module must not hide the verb."""

    def __setattr__(self, name: str, value: Any) -> None:
        if not (name in _HOME and isinstance(value, ModuleType)):
            super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package


def __getattr__(name: str) -> Any:
    if name in _MODULES:
        return import_module(f".{_MODULES[name]}", __name__)
    if name not in _HOME:
        raise AttributeError(f"module 'sarcl' has no attribute {name!r}")
    value = getattr(import_module(f".{_HOME[name]}", __name__), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted([*globals(), *_HOME])

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

__version__ = "0.1.0"

# Imported on first use: `sarcl --help` must not wait for numpy, and nothing probes a device at import.
_HOME = {
    "Waveform": "waveform",
    "Trajectory": "trajectory",
    "Scene": "scene",
    "Material": "material",
    "Antenna": "antenna",
    "AntennaArray": "array",
    "Radar": "radar",
    "PhaseHistory": "phase_history",
    "concatenate": "phase_history",
    "ImageGrid": "grid",
    "Image": "image",
    "Report": "report",
    "Scenario": "scenario",
    "echo": "echo",
    "beam": "beam",
    "ambiguity": "ambiguity",
    "Ambiguity": "ambiguity",
    "compress": "compress",
    "backproject": "backproject",
    "polar_format": "polar_format",
    "plan": "forecast",
    "Forecast": "forecast",
    "plan_echo": "echo_forecast",
    "EchoForecast": "echo_forecast",
    "add_noise": "noise",
    "autofocus": "autofocus",
    "map_aperture": "aperture",
    "measure": "quality",
    "PointResponse": "quality",
    "read": "read",
    "devices": "cl",
    "NoDeviceError": "cl",
    "SarclWarning": "check",
    "ToleranceMissed": "check",
}

__all__ = sorted(_HOME)

if TYPE_CHECKING:
    from .ambiguity import Ambiguity as Ambiguity
    from .ambiguity import ambiguity as ambiguity
    from .antenna import Antenna as Antenna
    from .aperture import map_aperture as map_aperture
    from .array import AntennaArray as AntennaArray
    from .autofocus import autofocus as autofocus
    from .backproject import backproject as backproject
    from .beam import beam as beam
    from .check import SarclWarning as SarclWarning
    from .check import ToleranceMissed as ToleranceMissed
    from .cl import NoDeviceError as NoDeviceError
    from .cl import devices as devices
    from .compress import compress as compress
    from .echo import echo as echo
    from .echo_forecast import EchoForecast as EchoForecast
    from .echo_forecast import plan_echo as plan_echo
    from .forecast import Forecast as Forecast
    from .forecast import plan as plan
    from .grid import ImageGrid as ImageGrid
    from .image import Image as Image
    from .material import Material as Material
    from .noise import add_noise as add_noise
    from .phase_history import PhaseHistory as PhaseHistory
    from .phase_history import concatenate as concatenate
    from .polar_format import polar_format as polar_format
    from .quality import PointResponse as PointResponse
    from .quality import measure as measure
    from .radar import Radar as Radar
    from .read import read as read
    from .report import Report as Report
    from .scenario import Scenario as Scenario
    from .scene import Scene as Scene
    from .trajectory import Trajectory as Trajectory
    from .waveform import Waveform as Waveform


class _Package(ModuleType):
    """A verb and its module share a name (`sarcl.echo`): importing the module must not hide the verb."""

    def __setattr__(self, name: str, value: Any) -> None:
        if not (name in _HOME and isinstance(value, ModuleType)):
            super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'sarcl' has no attribute {name!r}")
    value = getattr(import_module(f".{_HOME[name]}", __name__), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted([*globals(), *_HOME])

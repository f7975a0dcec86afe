# The one list of public names, with the file that defines each. sarcl/__init__.py reads it when a name is first used;
# type checkers and editors read it as it stands.

from .analysis.point_response import PointResponse as PointResponse
from .analysis.point_response import measure as measure
from .arrays import array_factor as array_factor
from .arrays.ambiguity import Ambiguity as Ambiguity
from .arrays.ambiguity import ambiguity as ambiguity
from .arrays.beam import beam as beam
from .arrays.map_aperture import map_aperture as map_aperture
from .base import progress as progress
from .base import wgs84 as wgs84
from .base.errors import SarclWarning as SarclWarning
from .base.errors import ToleranceMissed as ToleranceMissed
from .base.errors import ToleranceUnreachable as ToleranceUnreachable
from .base.forecast import Forecast as Forecast
from .base.options import Options as Options
from .base.options import option as option
from .base.report import Report as Report
from .base.verb import verb as verb
from .base.version import __version__ as __version__
from .earth.elevation import ElevationModel as ElevationModel
from .effects import motion as motion
from .effects import noise as noise
from .effects import stop_and_go as stop_and_go
from .effects.noise import add_noise as add_noise
from .experiments import fda as fda
from .imaging.compress import compress as compress
from .imaging.default_grid import default_grid as default_grid
from .imaging.strip_map import EffectiveVelocity as EffectiveVelocity
from .imaging.strip_map import doppler_centroid as doppler_centroid
from .imaging.strip_map import effective_velocity as effective_velocity
from .model import pointing as pointing
from .model import radar as radar
from .model.antenna import Antenna as Antenna
from .model.antenna_array import AntennaArray as AntennaArray
from .model.concatenation import concatenate as concatenate
from .model.image import Image as Image
from .model.image_grid import ImageGrid as ImageGrid
from .model.orbit import Orbit as Orbit
from .model.phase_history import PhaseHistory as PhaseHistory
from .model.radar import Radar as Radar
from .model.store import read as read
from .model.trajectory import Trajectory as Trajectory
from .model.waveform import Waveform as Waveform
from .opencl.choose_device import NoDeviceError as NoDeviceError
from .opencl.device_list import devices as devices
from .phase_correction.autofocus import autofocus as autofocus
from .scenario.scenario import Scenario as Scenario
from .scene import material as material
from .scene import shapes as shapes
from .scene.material import Material as Material
from .scene.scene import Scene as Scene
from .verbs import backproject as backproject
from .verbs import echo as echo
from .verbs import fullwave_echo as fullwave_echo
from .verbs import plan as plan
from .verbs import polar_format as polar_format
from .verbs import range_doppler as range_doppler
from .verbs import rcs as rcs
from .verbs import spectral_echo as spectral_echo
from .visibility import illumination as illumination

from . import linear as linear  # isort: skip
from . import papers as papers  # isort: skip
from . import scenario as scenario  # isort: skip

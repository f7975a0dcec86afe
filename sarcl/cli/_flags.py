"""Options of the verbs for the parser of the command line, which imports nothing that takes time.

Made from the verbs' records by python docs/developers/write_options.py
"""

from typing import Any

# verb -> option -> its default
DEFAULTS: dict[str, dict[str, Any]] = {
    "backproject": {
        "method": "auto",
        "beam": None,
        "mapping": None,
        "wrap": False,
        "skip": True,
        "out": None,
        "resume": None,
        "tile": None,
        "device": None,
        "cluster": None,
        "sum_polarizations": False,
        "window": None,
        "weights": None,
        "tolerance": 0.001,
        "max_bytes": None,
        "check": None,
        "progress": None,
    },
    "polar_format": {
        "tolerance": 0.01,
        "sum_polarizations": False,
        "window": None,
        "weights": None,
        "out": None,
        "max_bytes": None,
        "check": None,
        "device": None,
        "progress": None,
    },
    "range_doppler": {
        "heights": 0.0,
        "side": None,
        "times": None,
        "ranges": None,
        "spacing": None,
        "beam": None,
        "doppler": "geometry",
        "near": None,
        "doppler_rate": "geometry",
        "tolerance": 0.01,
        "max_bytes": None,
        "check": None,
        "window": None,
        "weights": None,
        "out": None,
        "device": None,
        "progress": None,
    },
}

# verb -> option -> the words that it takes, where it takes nothing else
CHOICES: dict[str, dict[str, tuple[str, ...]]] = {
    "backproject": {
        "method": ("auto", "direct", "factorized"),
        "mapping": ("corrected", "apparent", "channels"),
    },
    "polar_format": {},
    "range_doppler": {
        "side": ("left", "right"),
    },
}

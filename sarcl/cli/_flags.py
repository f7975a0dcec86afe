"""Options of the verbs for the parser of the command line, which imports nothing that takes time.

flags.json is made from the verbs' records by python docs/developers/write_options.py
"""

import json
from pkgutil import get_data
from typing import Any

_TABLES = json.loads(get_data(__package__, "flags.json") or "")

# verb -> option -> its default
DEFAULTS: dict[str, dict[str, Any]] = _TABLES["defaults"]
# verb -> option -> the words that it takes, where it takes nothing else
CHOICES: dict[str, dict[str, list[str]]] = _TABLES["choices"]

# methods of `sarcl focus` of sarcl itself
METHODS = (*CHOICES["backproject"]["method"], "polar_format", "range_doppler")

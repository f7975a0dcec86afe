"""Dates in UTC, as strings, datetimes or numpy's datetime64."""

from __future__ import annotations

import datetime
import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Date = str | datetime.date | np.datetime64  # a datetime.datetime is a datetime.date


def date(value: Date) -> np.datetime64:
    """A date in UTC, to the nanosecond."""
    if isinstance(value, datetime.datetime) and value.tzinfo is not None:
        value = value.astimezone(datetime.UTC).replace(tzinfo=None)
    if isinstance(value, str):
        value = value.removesuffix("Z")
        if not re.fullmatch(r"\d{4}-\d\d-\d\d(T\d\d:\d\d(:\d\d(\.\d{1,9})?)?)?", value):
            raise ValueError(f"date {value!r} is not in UTC as wanted, such as '2021-12-23T05:10:21.029300'")
    return np.datetime64(value).astype("datetime64[ns]")


def seconds(dates: Date | Sequence[Date] | NDArray[np.datetime64], epoch: np.datetime64) -> NDArray[np.float64]:
    """Seconds (...) from an epoch to dates (...), of days of 86 400 s."""
    if isinstance(dates, (str, datetime.date)):
        dates = date(dates)
    elif not isinstance(dates, (np.datetime64, np.ndarray)):
        dates = np.array([date(d) for d in dates])
    return np.asarray((np.asarray(dates).astype("datetime64[ns]") - epoch) / np.timedelta64(1, "ns") * 1e-9)

"""Dates in UTC, as strings, datetimes or numpy's datetime64."""

from __future__ import annotations

import datetime
import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Date = str | datetime.date | np.datetime64  # a datetime.datetime is a datetime.date


YEARS = 1678, 2261  # first and last year that nanoseconds in 64 bits reach
WANTED = "wanted UTC such as '2021-12-23T05:10:21.029300', a datetime or numpy's datetime64"


def date(value: Date) -> np.datetime64:
    """A date in UTC, to the nanosecond. ValueError for other text, NaT, leap seconds, and years that do not fit."""
    argument = value
    if isinstance(value, datetime.datetime) and value.tzinfo is not None:
        value = value.astimezone(datetime.UTC).replace(tzinfo=None)
    if isinstance(value, str):
        value = value.removesuffix("Z")
        if not re.fullmatch(r"\d{4}-\d\d-\d\d(T\d\d:\d\d(:\d\d(\.\d{1,9})?)?)?", value):
            raise ValueError(f"date {argument!r} is not in UTC as wanted, such as '2021-12-23T05:10:21.029300'")
        if value[17:19] == "60":
            raise ValueError(f"date {argument!r} is within a leap second, which days of 86 400 s have not")
    elif not isinstance(value, (datetime.date, np.datetime64)):
        raise ValueError(f"date {argument!r} is a {type(argument).__name__}; {WANTED}")
    try:
        instant = np.asarray(value, np.datetime64)
    except ValueError as exc:
        raise ValueError(f"date {argument!r} does not exist ({exc}); {WANTED}") from None
    return np.datetime64(_in_nanoseconds(instant).item(), "ns")


def seconds(dates: Date | Sequence[Date] | NDArray[np.datetime64], epoch: np.datetime64) -> NDArray[np.float64]:
    """Seconds (...) from an epoch to dates (...), of days of 86 400 s."""
    if isinstance(dates, (str, datetime.date, np.datetime64)):
        instants = np.asarray(date(dates))
    else:
        values = np.asarray(dates)
        if values.dtype.kind != "M":  # text, datetimes, or none of them
            values = np.array([date(d) for d in values.ravel().tolist()], "datetime64[ns]").reshape(values.shape)
        instants = _in_nanoseconds(values)
    return np.asarray((instants - epoch) / np.timedelta64(1, "ns") * 1e-9)


def _in_nanoseconds(dates: NDArray[np.datetime64]) -> NDArray[np.datetime64]:
    """Dates (...) as datetime64[ns], which would wrap around in silence."""
    if np.isnat(dates).any():
        raise ValueError(f"a date is NaT (not a time); {WANTED}")
    years = dates.astype("datetime64[Y]").astype(np.int64) + 1970
    if ((years < YEARS[0]) | (years > YEARS[1])).any():
        raise ValueError(f"dates reach from {dates.min()} to {dates.max()}; give years from {YEARS[0]} to {YEARS[1]}")
    return dates.astype("datetime64[ns]")

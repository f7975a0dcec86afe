"""Echoes of arrays: channel by channel, or interpolated over the array.

For other folders:

    array_echo             echoes of all channels, summed at a receiver or kept separate
    channel_rows           rows of an array's echoes: antennas, elements, references

For this folder alone:

    _chebyshev_positions   positions in the array at which echoes are computed
    _interpolated          channels interpolated between these positions
    _response_samples      how echoes change from position to position
    _separate              every channel computed by itself
"""

__all__ = ["array_echo", "channel_rows"]

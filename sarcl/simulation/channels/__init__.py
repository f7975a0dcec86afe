"""Echoes of arrays: channel by channel, or interpolated over the array.

For other folders:

    array_channels         rows and samples of all channels, summed at each receiver or kept separate

For this folder alone:

    _channel_rows          rows of the phase history: antenna positions of every channel, reference ranges
    _chebyshev_positions   positions in the array from which echoes are interpolated to all elements
    _interpolated          echoes of channels, interpolated from these positions
    _response_samples      how echoes change from position to position in the array
    _separate              layout of channels in the samples; echoes computed channel by channel
"""

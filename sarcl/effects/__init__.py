"""Noise and motion, which ideal echoes lack.

For other folders:

    motion           errors of the track, positions known or not, targets that move
    noise            add_noise: receiver noise at a stated level of the image
    stop_and_go      errors of the stop-and-go approximation, and echoes without it

For this folder alone:

    _random_motion   smooth random motion: sums of cosines
"""

__all__ = ["motion", "noise", "stop_and_go"]

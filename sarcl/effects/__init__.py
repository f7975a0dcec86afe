"""Noise and motion, added to ideal echoes.

For other folders:

    motion           errors of the track, known to the processor or not; moving targets
    noise            add_noise: receiver noise at a stated level of the image
    stop_and_go      errors of the stop-and-go approximation, and echoes without it

For this folder alone:

    _random_motion   smooth random processes: sums of cosines
"""

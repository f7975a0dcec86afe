"""Echoes of points: at each pulse by themselves, or factorised.

For other folders:

    direct        points to range profiles, block by block of pulses: a nonuniform FFT of type 1
    point_plan    the method for a channel, and the plan of its points
"""

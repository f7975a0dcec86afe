"""Polar format: wavefronts taken as planes.

For other folders:

    polar_format   polar_format(): the image, and the error of plane wavefronts; plan_polar_format()

For this folder alone:

    _samples       weighted samples, made on the device or on the host
    _wavefront     wavenumbers of plane waves, and the error of neglected curvature
"""

__all__ = ["polar_format"]

"""Polar format: wavefronts taken as planes.

For other folders:

    polar_format   polar_format(): the image, its plan, and the error of plane wavefronts

For this folder alone:

    _samples       weighted samples, made on the device or on the host
    _wavefront     wavenumbers of plane waves, and the error of neglected curvature
"""

"""autofocus(): phase errors estimated from the echoes themselves.

For other folders:

    autofocus          autofocus(): phase and range error of every pulse, estimated and removed

For this folder alone:

    _aperture_view     pulses of an aperture with trial corrections, and their images on a grid
    _bright_points     bright points of an image, and the contribution of each row to them
    _phase_gradient    phase of each pulse from its contributions
    _phase_smoothing   phase over the aperture: smoothed, unwrapped
    _search            search for the phases and ranges that maximise the sharpness of bright points
"""

__all__ = ["autofocus"]

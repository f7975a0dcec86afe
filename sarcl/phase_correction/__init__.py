"""autofocus(): phase errors estimated from the echoes themselves.

For other folders:

    autofocus          autofocus(): phase and range error of every pulse, estimated and removed

For this folder alone:

    _aperture_view     pulses as seen on a grid, with trial corrections
    _bright_points     bright places of an image, and each row's contribution to them
    _phase_gradient    phase of each pulse from its contributions
    _phase_smoothing   phase over the aperture: smoothed, unwrapped
    _search            phases and ranges that make the bright places sharpest
"""

__all__ = ["autofocus"]

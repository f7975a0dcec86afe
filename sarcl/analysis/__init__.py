"""measure(): what an image shows.

For other folders:

    point_response        measure(): position, resolution and side lobes of a point

For this folder alone:

    _image_interpolator   a complex image between its pixels
    _peaks                the brightest pixel, or the peak near a position
"""

__all__ = ["point_response"]

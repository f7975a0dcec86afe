"""measure(): the response of a point in an image.

For other folders:

    point_response        measure(): position, resolution and side lobes of a point

For this folder alone:

    _image_interpolator   values of a complex image between its pixels
    _peaks                search for the brightest pixel, or for the peak near a position
    _surface              the grid, or the plane that touches a grid of listed points
"""

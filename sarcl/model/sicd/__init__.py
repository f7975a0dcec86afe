"""Images as SICD files. sarcl/io/sicd has the files themselves; docs/theory/sicd.md the phase and its spectrum.

For other folders:

    image_product   an image and the echoes that it was made of as what a SICD file says; what is missing is refused

For this folder alone:

    _polynomials    polynomials of time and of image coordinates, fitted and checked
    _spectrum       spatial frequencies of an image, pixel by pixel, and the time at which a pixel is seen
"""

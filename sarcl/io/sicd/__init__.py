"""SICD, complex images with their collection (NGA.STND.0024), in NITF files. docs/theory/sicd.md has the phase.

For other folders:

    writing        an image and its metadata as a file

For this folder alone:

    _pixel_rows    rows of pixels: read when they are asked for, with the phase of sarcl's images
    _product       the XML of a file that is written
    _reading       a file as the fields of an image; pixels stay in the file (sarcl/io/formats.py imports it)
"""

"""Pictures and pages of plain arrays.

For other folders:

    axes       frame, ticks and title of a picture
    decibels   grey images and line plots in decibels, with Pillow
    html       one self-contained HTML page: headings, tables, drawings
"""

__all__ = ["axes", "decibels", "html"]

"""Pictures, plots and pages of plain arrays.

For other folders:

    decibels   grey images and line plots in decibels, with Pillow
    html       a page in one file: strip of pictures, tables, figures; needs the extra `plots`
    plots      plots as PNG files, with matplotlib; needs the extra `plots`

For this folder alone:

    _axes      frame, ticks, title and caption of a picture; frames of curves
"""

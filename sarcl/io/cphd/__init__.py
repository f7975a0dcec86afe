"""CPHD, compensated phase history data (NGA.STND.0068), versions 1.0.1 and 1.1.0. docs/theory/cphd.md has the physics.

For other folders:

    names          names of the collection in the XML of a file
    writing        a collection as a file

For this folder alone:

    _channels      the channels of a file, their polarisations, which of them are chosen
    _domains       samples by time of arrival as samples by frequency, and back
    _product       the XML of a file that is written
    _reading       a file as the fields of a phase history; samples stay in the file (sarcl/io/formats.py imports it)
    _signal_rows   rows of the signal arrays: read when they are asked for, in the conventions of a phase history
"""

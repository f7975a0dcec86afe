"""Readers and writers of files, one module a format.

paths   output paths checked before the work; files that appear whole or not at all
store   sarcl's own lossless HDF5: phase histories and images
hdf5    what store needs of HDF5: plain values in and out
gotcha  the AFRL Gotcha volumetric data set, MATLAB 5
"""

"""File formats, read and written as plain arrays. sarcl/model/store.py makes objects of them.

For other folders:

    added_grids    grids of installed packages: positions of their pixels, by blocks
    elevation      elevation models through rasterio: positions on WGS84
    cphd/          CPHD and CRSD files
    entry_points   objects that installed packages add: file formats, grids, scattering models, verbs
    geotiff        images as GeoTIFF through rasterio, with overviews
    formats        table of the file formats of phase histories and images: names, first bytes, reader, writers
    hdf5           plain values, arrays and reports in HDF5
    input_paths    input files: regular files that can be read, named where they are not
    labelled_files  images as Zarr stores and NetCDF files, and the package xarray
    meshes/        mesh files through trimesh
    orbit_files    state vectors of orbit files in XML
    other_files    files that a mesh or an elevation model names: those of its own folder
    output_paths   output files: checked before the computation, written completely or not at all
    sarkit_library  sarkit's modules for CPHD, CRSD and SICD, and the files that they read in place
    sarcl_hdf5     sarcl's own HDF5 file: a phase history or an image, read and written as plain fields
    sicd/          SICD files
    toml           TOML: line numbers of keys, and values written back as text
    xml/           XML files of others, and virtual rasters

For this folder alone:

    _checked_rows  rows of an HDF5 file, whose checksums are compared when they are read
    _checksums     checksums of HDF5 and NetCDF files, behind their end
    _gotcha        AFRL Gotcha volumetric SAR data set, MATLAB 5
    _hdf5_safety   HDF5 files that lead into others: refused
    _mat5_checks   the structure of a MATLAB 5 file, walked before scipy reads it
    _part          files that are being written: random names, locked, removed where no process owns them
    _partial_hdf5  an HDF5 file that appears at its path only when it is complete
"""

"""File formats, read and written as plain arrays. sarcl/model/store.py makes objects of them.

For other folders:

    elevation      elevation models through rasterio: positions on WGS84
    formats        table of the file formats of phase histories and images: names, first bytes, reader, writers
    hdf5           plain values, arrays and reports in HDF5
    mesh           meshes through trimesh: triangles, names of parts, repairs
    orbit_files    state vectors of orbit files in XML
    output_paths   output files: checked before the computation, written completely or not at all
    sarcl_hdf5     sarcl's own HDF5 file: a phase history or an image, read and written as plain fields
    toml           TOML: line numbers of keys, and values written back as text

For this folder alone:

    _gotcha        AFRL Gotcha volumetric SAR data set, MATLAB 5
    _partial_hdf5  an HDF5 file that appears at its path only when it is complete
"""

__all__ = ["elevation", "formats", "hdf5", "mesh", "orbit_files", "output_paths", "sarcl_hdf5", "toml"]

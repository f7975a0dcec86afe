"""File formats, read and written as plain arrays. sarcl/model/store.py makes objects of them.

For other folders:

    elevation      elevation models through rasterio: positions on WGS84
    formats        table of the file formats of phase histories and images: names, first bytes, reader, writers
    hdf5           plain values, arrays and reports in HDF5
    input_paths    input files: regular files that can be read, named where they are not
    labelled_files  images as Zarr stores and NetCDF files, and the package xarray
    mesh           meshes through trimesh: triangles, names of parts, repaired
    orbit_files    state vectors of orbit files in XML
    output_paths   output files: checked before the computation, written completely or not at all
    sarcl_hdf5     sarcl's own HDF5 file: a phase history or an image, read and written as plain fields
    toml           TOML: line numbers of keys, and values written back as text
    xml/           XML files of others, and virtual rasters

For this folder alone:

    _checked_rows  rows of an HDF5 file, whose checksums are compared when they are read
    _checksums     checksums of sarcl's own HDF5 file, behind its end
    _collada_checks  surfaces of COLLADA files that would be left out or covered wrongly in silence: refused
    _gltf_checks   surfaces of glTF files that would be left out in silence: refused
    _gotcha        AFRL Gotcha volumetric SAR data set, MATLAB 5
    _hdf5_safety   HDF5 files that lead into others: refused
    _mat5_checks   the structure of a MATLAB 5 file, walked before scipy reads it
    _mesh_archive  meshes in archives
    _mesh_checks   faces that a mesh file declares and holds; polygons and the fans that cover them
    _mesh_repair   repairs of meshes: winding, faces that collapse or repeat
    _mesh_text     text of .obj and .off files: as trimesh reads it right, or refused
    _other_files   files that a mesh or an elevation model names: those of its own folder
    _part          files that are being written: random names, locked, removed where no process owns them
    _partial_hdf5  an HDF5 file that appears at its path only when it is complete
    _ply           PLY files: vertices and polygons, each number of the type that its header declares
"""

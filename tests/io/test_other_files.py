"""Meshes and elevation models that name other files: those beside them are read, others where it is allowed."""

from __future__ import annotations

import base64
import json
import os

import numpy as np
import pytest
import trimesh

import sarcl

BOX = trimesh.creation.box((1, 2, 3))


def gltf(folder, uri):
    """A .gltf file whose buffer is in the file that `uri` names; the buffer."""
    vertices, faces = BOX.vertices.astype("<f4"), BOX.faces.astype("<u4")
    buffer = vertices.tobytes() + faces.tobytes()
    views = [
        {"buffer": 0, "byteOffset": 0, "byteLength": vertices.nbytes},
        {"buffer": 0, "byteOffset": vertices.nbytes, "byteLength": faces.nbytes},
    ]
    accessors = [
        {"bufferView": 0, "componentType": 5126, "count": len(vertices), "type": "VEC3",
         "min": vertices.min(axis=0).tolist(), "max": vertices.max(axis=0).tolist()},
        {"bufferView": 1, "componentType": 5125, "count": faces.size, "type": "SCALAR"},
    ]  # fmt: skip
    tree = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "buffers": [{"uri": uri, "byteLength": len(buffer)}], "bufferViews": views, "accessors": accessors,
    }  # fmt: skip
    (folder / "a.gltf").write_text(json.dumps(tree))
    return buffer


@pytest.fixture
def inside(tmp_path):
    """A folder in a folder."""
    (tmp_path / "inside").mkdir()
    return tmp_path / "inside"


@pytest.mark.parametrize("uri", ["box.bin", "parts/box.bin", "./box%20one.bin"])
def test_buffers_in_the_folder_of_a_gltf_file_are_read(inside, uri):
    buffer = gltf(inside, uri)
    path = inside / uri.replace("%20", " ")
    path.parent.mkdir(exist_ok=True)
    path.write_bytes(buffer)
    assert len(sarcl.Scene.from_mesh(inside / "a.gltf").triangles) == 12


def test_buffers_within_a_gltf_file_are_read(inside):
    buffer = gltf(inside, "x")
    gltf(inside, "data:application/octet-stream;base64," + base64.b64encode(buffer).decode())
    assert len(sarcl.Scene.from_mesh(inside / "a.gltf").triangles) == 12


@pytest.mark.parametrize("how", ["above", "absolute", "by a link", "by a code"])
def test_buffers_elsewhere_are_refused_unless_allowed(inside, how):
    secret = inside.parent / "secret.bin"
    uri = {"above": "../secret.bin", "absolute": str(secret), "by a link": "link.bin", "by a code": "%2e%2e/secret.bin"}
    secret.write_bytes(gltf(inside, uri[how]))
    (inside / "secret.bin").write_bytes(b"not this one")
    if how == "by a link":
        (inside / "link.bin").symlink_to(secret)
    with pytest.raises(
        ValueError, match=r"'a\.gltf' leads to another file: .*outside its folder.*external=True allows"
    ):
        sarcl.Scene.from_mesh(inside / "a.gltf")
    assert len(sarcl.Scene.from_mesh(inside / "a.gltf", external=True).triangles) == 12


def test_a_buffer_that_is_missing_or_a_pipe_is_named(inside):
    gltf(inside, "box.bin")
    with pytest.raises(ValueError, match=r"'a\.gltf' cannot be read as \.gltf \(there is no file 'box\.bin' beside it"):
        sarcl.Scene.from_mesh(inside / "a.gltf")
    os.mkfifo(inside / "box.bin")
    with pytest.raises(ValueError, match=r"'a\.gltf' cannot be read .*box\.bin' is a pipe"):
        sarcl.Scene.from_mesh(inside / "a.gltf")


def obj(folder, library):
    (folder / "a.obj").write_text(
        f"mtllib {library}\n" + BOX.export(file_type="obj").replace("f ", "usemtl red\nf ", 1)
    )


def test_materials_of_an_obj_file_are_those_beside_it(inside):
    obj(inside, "a.mtl")
    (inside / "a.mtl").write_text("newmtl red\nKd 1 0 0\nmap_Kd ../wood.png\n")
    scene = sarcl.Scene.from_mesh(inside / "a.obj", material={"red": "metal"})
    assert len(scene.triangles) == 12


@pytest.mark.parametrize("library", ["../a.mtl", "/etc/hostname"])
def test_materials_elsewhere_are_refused_unless_allowed(inside, library):
    obj(inside, library)
    (inside.parent / "a.mtl").write_text("newmtl red\nKd 1 0 0\n")
    with pytest.raises(ValueError, match=r"'a\.obj' leads to another file: '.*', outside its folder"):
        sarcl.Scene.from_mesh(inside / "a.obj")
    assert len(sarcl.Scene.from_mesh(inside / "a.obj", external=True).triangles) == 12


# Elevation models ------------------------------------------------------------------------------------------


def tif(path, crs="EPSG:4979"):
    rasterio = pytest.importorskip("rasterio", reason="no rasterio: pip install sarcl[maps]")
    with rasterio.open(
        path, "w", driver="GTiff", height=4, width=5, count=1, dtype="float32", crs=crs,
        transform=rasterio.Affine(0.001, 0, 12, 0, -0.001, 42),
    ) as file:  # fmt: skip
        file.write(np.arange(20, dtype="f4").reshape(1, 4, 5))


def vrt(path, source, relative=1, crs="EPSG:4979"):
    path.write_text(
        f'<VRTDataset rasterXSize="5" rasterYSize="4"><SRS>{crs}</SRS>'
        "<GeoTransform>12, 0.001, 0, 42, 0, -0.001</GeoTransform>"
        '<VRTRasterBand dataType="Float32" band="1"><SimpleSource>'
        f'<SourceFilename relativeToVRT="{relative}">{source}</SourceFilename><SourceBand>1</SourceBand>'
        "</SimpleSource></VRTRasterBand></VRTDataset>"
    )


READERS = {
    "ElevationModel.read": lambda path, **more: sarcl.ElevationModel.read(path, heights="ellipsoid", **more).height,
    "from_dem": lambda path, **more: sarcl.Scene.from_dem(path, heights="ellipsoid", **more).triangles,
    "on_terrain": lambda path, **more: sarcl.ImageGrid.on_terrain(path, 20.0, heights="ellipsoid", **more).listed,
}


@pytest.mark.parametrize("read", READERS.values(), ids=READERS)
def test_a_virtual_raster_is_read_from_its_folder_and_elsewhere_where_that_is_allowed(inside, read):
    for folder in (inside, inside.parent):
        tif(folder / "a.tif")
    vrt(inside / "beside.vrt", "a.tif")
    vrt(inside / "again.vrt", "beside.vrt")
    wanted = read(inside / "a.tif")
    for name in ("beside.vrt", "again.vrt"):
        assert np.array_equal(read(inside / name), wanted)
    for source, relative in (("../a.tif", 1), (str(inside.parent / "a.tif"), 0)):
        vrt(inside / "away.vrt", source, relative)
        vrt(inside / "twice.vrt", "away.vrt")
        for name in ("away.vrt", "twice.vrt"):
            with pytest.raises(ValueError, match=rf"'{name}' leads to another file: .*a\.tif', outside.*external=True"):
                read(inside / name)
            assert np.array_equal(read(inside / name, external=True), wanted)


@pytest.mark.parametrize("source", ["/vsicurl/http://localhost/a.tif", "http://localhost/a.tif", "/vsimem/a", "b.tif"])
def test_sources_that_are_no_files_of_the_folder_are_refused(inside, source):
    pytest.importorskip("rasterio")
    vrt(inside / "a.vrt", source)
    with pytest.raises(ValueError, match=r"'a\.vrt' (leads to another file|names .* there is no such file)"):
        sarcl.ElevationModel.read(inside / "a.vrt", heights="ellipsoid")


HEAD = (
    '<VRTDataset rasterXSize="5" rasterYSize="4"{more}><SRS>{crs}</SRS>'
    "<GeoTransform>12, 0.001, 0, 42, 0, -0.001</GeoTransform>"
)
BAND = '<VRTRasterBand dataType="Float32" band="1">'
BESIDE = (
    '<SimpleSource><SourceFilename relativeToVRT="1">a.tif</SourceFilename><SourceBand>1</SourceBand></SimpleSource>'
)


def raster(head="", source=BESIDE, crs="EPSG:4979", more=""):
    return f"{HEAD.format(crs=crs, more=more)}{head}{BAND}{source}</VRTRasterBand></VRTDataset>"


PROCESSED = (
    '<VRTDataset subClass="VRTProcessedDataset"><Input><SourceFilename relativeToVRT="1">a.tif</SourceFilename></Input>'
    '<ProcessingSteps><Step name="s"><Algorithm>LocalScaleOffset</Algorithm>'
    '<Argument name="gain_dataset_filename_1">../a.tif</Argument><Argument name="gain_dataset_band_1">1</Argument>'
    '<Argument name="offset_dataset_filename_1">../a.tif</Argument><Argument name="offset_dataset_band_1">1</Argument>'
    "</Step></ProcessingSteps></VRTDataset>"
)
WARPED = (
    "<GDALWarpOptions><SourceDataset relativeToVRT='1'>a.tif</SourceDataset><Transformer><GenImgProjTransformer>"
    "<SrcRPCTransformer><RPCTransformer><DEMPath>../a.tif</DEMPath></RPCTransformer></SrcRPCTransformer>"
    "</GenImgProjTransformer></Transformer></GDALWarpOptions>"
)
LEADS = {  # the last: what GDAL takes for a source, and XML does not
    "an argument": (PROCESSED, "subClass> 'VRTProcessedDataset'"),
    "a processed source": (raster(source=PROCESSED), "<VRTDataset>"),
    "DEMPath": (raster(WARPED, more=' subClass="VRTWarpedDataset"'), "<SrcRPCTransformer>"),
    "an attribute": (raster(source='<SimpleSource SourceFilename="../a.tif" SourceBand="1"/>'), "SourceFilename>"),
    "a system in a file": (raster(crs="../a.wkt"), r"<SRS> '../a.wkt'"),
    "a system on a network": (raster(crs="http://localhost/a"), "<SRS> 'http"),
    "a grid of PROJ": (raster(crs="+proj=longlat +nadgrids=a.gsb"), r"<SRS> '\+proj"),
    "overviews": (
        raster('<Metadata domain="OVERVIEWS"><MDI key="OVERVIEW_FILE">../a.tif</MDI></Metadata>'),
        "domain> 'OVERVIEWS'",
    ),
    "options of drivers": (raster(source="<SimpleSource><OpenOptions/></SimpleSource>"), "<OpenOptions>"),
    "an option of warping": (raster('<GDALWarpOptions><Option name="X">../a</Option></GDALWarpOptions>'), "option 'X'"),
    "Python": (raster(source="<PixelFunctionLanguage>Python</PixelFunctionLanguage>"), "<PixelFunctionLanguage>"),
    "an instruction": (raster("<?x <SourceFilename>../a.tif</SourceFilename> ?>"), r"instruction \(<\?x"),
    "text around an element": (
        raster(source="<SimpleSource><SourceFilename>../a.tif<a/></SourceFilename></SimpleSource>"),
        "no name in its folder",
    ),
}  # fmt: skip


@pytest.mark.parametrize("how", LEADS)
def test_what_a_virtual_raster_holds_beside_the_harmless_is_refused(inside, how):
    pytest.importorskip("rasterio")
    for folder in (inside, inside.parent):
        tif(folder / "a.tif")
    text, wanted = LEADS[how]
    (inside / "a.vrt").write_text(text)
    vrt(inside / "b.vrt", "a.vrt")
    for name in ("a.vrt", "b.vrt"):
        with pytest.raises(ValueError, match=rf"DEM '{name}' .*{wanted}"):
            sarcl.ElevationModel.read(inside / name, heights="ellipsoid")


def test_names_that_count_from_the_current_folder_are_looked_for_there(inside, monkeypatch):
    for folder in (inside, inside.parent):
        tif(folder / "a.tif")
    vrt(inside / "a.vrt", "a.tif", relative=0)
    monkeypatch.chdir(inside.parent)
    with pytest.raises(
        ValueError, match=rf"leads to another file: '{inside.parent}/a\.tif', outside"
    ):  # before GDAL opens it
        sarcl.ElevationModel.read(inside / "a.vrt", heights="ellipsoid")
    monkeypatch.chdir(inside)
    assert sarcl.ElevationModel.read(inside / "a.vrt", heights="ellipsoid").height.shape == (4, 5)


@pytest.mark.parametrize("crs", [None, "EPSG:32633"])
def test_virtual_rasters_as_gdal_writes_them_are_read(inside, crs):
    tif(inside / "a.tif")
    import rasterio
    import rasterio.shutil
    from rasterio.vrt import WarpedVRT

    with rasterio.open(inside / "a.tif") as file, WarpedVRT(file, crs=crs or file.crs) as warped:
        rasterio.shutil.copy(warped if crs else file, inside / "a.vrt", driver="VRT")
        wanted = warped.read(1)
    found = sarcl.ElevationModel.read(inside / "a.vrt", heights="ellipsoid", nodata=0).height
    assert np.array_equal(np.nan_to_num(found), wanted)


def test_rasters_that_name_themselves_or_an_address_are_refused(inside):
    pytest.importorskip("rasterio")
    vrt(inside / "a.vrt", "a.vrt")
    with pytest.raises(ValueError, match=r"'a\.vrt' is a virtual raster of virtual rasters, 8 deep"):
        sarcl.ElevationModel.read(inside / "a.vrt")
    (inside / "a.xml").write_text(
        "<GDAL_WMS><Service name='TMS'><ServerUrl>http://localhost/</ServerUrl></Service></GDAL_WMS>"
    )
    with pytest.raises(ValueError, match=r"'a\.xml' is XML of the kind 'GDAL_WMS', which names a raster elsewhere"):
        sarcl.ElevationModel.read(inside / "a.xml")
    (inside / "a.json").write_text('{"type": "FeatureCollection", "stac_version": "1.0.0", "features": []}')
    with pytest.raises(ValueError, match=r"'a\.json' is a list of rasters elsewhere, and no raster"):
        sarcl.ElevationModel.read(inside / "a.json")


def test_a_geoid_that_leads_elsewhere_is_refused_unless_allowed(inside):
    for path in (inside / "a.tif", inside.parent / "geoid.tif"):
        tif(path, "EPSG:4326")
    vrt(inside / "geoid.vrt", "../geoid.tif", crs="EPSG:4326")
    options = {"heights": "EGM96", "geoid": inside / "geoid.vrt"}
    with pytest.raises(ValueError, match=r"geoid 'geoid\.vrt' leads to another file"):
        sarcl.ElevationModel.read(inside / "a.tif", **options)
    found = sarcl.ElevationModel.read(inside / "a.tif", **{**options, "external": True})
    assert np.allclose(found.height, 2 * np.arange(20).reshape(4, 5))


def test_heights_in_hdf5_that_lie_in_another_file_are_refused(inside):
    pytest.importorskip("rasterio")
    import h5py

    np.arange(20, dtype="f4").tofile(inside.parent / "secret.bin")
    with h5py.File(inside / "a.h5", "w") as file:
        file.create_dataset("z", (4, 5), "f4", external=[(str(inside.parent / "secret.bin"), 0, 80)])
    with pytest.raises(ValueError, match=r"'a\.h5' leads into another file: z lies into .*external=True allows it"):
        sarcl.ElevationModel.read(inside / "a.h5")

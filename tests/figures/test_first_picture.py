"""README's first picture shows what its text says."""

import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

README = (Path(__file__).parents[2] / "README.md").read_text()


@pytest.mark.slow  # the quick tests run the same lines as a block of README.md
def test_walls_are_bright_shadows_black_the_road_dark_and_the_reflector_white(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names: dict = {}
    exec(compile(re.search(r"```python\n(import numpy.*?)```", README, re.S)[1], "README.md", "exec"), names)
    image = names["image"]
    with Image.open("airfield.png") as saved:
        text, whole = saved.text, np.asarray(saved.convert("L"))
    left, top, right, bottom = image.show().info["frame"]
    grey = whole[top:bottom, left:right][::-1].astype(float)
    scale = grey.shape[0] / image.grid.shape[0]

    def mean(x, y, half=1.0):
        (i, j), n = image.grid.index((x, y, 0.0)) * scale, half / 0.1 * scale
        return grey[round(i - n) : round(i + n), round(j - n) : round(j + n)].mean()

    grass, road, hangar = mean(-5, 8), mean(5, 0), mean(8, 16)
    assert hangar > grass + 80 and grass > road + 30
    for x, y in ((8, 7), (-12, 6), (-11, -14), (0, -16)):  # behind the hangar, the tower and both tanks
        assert mean(x, y, 0.5) < 5
    assert mean(-9, -8) > grass + 40 and mean(2, -8) > grass + 40  # tanks
    i, j = np.rint(image.grid.index((-15, 0.056, 0.0)) * scale).astype(int)
    assert grey[i, j] == 255 and abs(names["sarcl"].measure(image, near=(-15, 0, 0.1)).rcs / 9 - 1) < 0.02
    assert 40 < grey.mean() < 120
    assert "(percentile 99.5 of the scene" in text["Description"]

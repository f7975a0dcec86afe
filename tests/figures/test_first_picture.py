"""README's first picture shows what its text says."""

import re
from pathlib import Path

import numpy as np
from PIL import Image

README = (Path(__file__).parents[2] / "README.md").read_text()


def test_slopes_towards_the_radar_are_bright_the_far_side_is_dark_and_the_reflectors_are_white(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names: dict = {}
    exec(compile(re.search(r"```python\n(import numpy.*?)```", README, re.S)[1], "README.md", "exec"), names)
    image = names["image"]
    with Image.open("hill.png") as saved:
        text, whole = saved.text, np.asarray(saved.convert("L"))
    left, top, right, bottom = image.show().info["frame"]
    grey = whole[top:bottom, left:right][::-1].astype(float)
    scale = grey.shape[0] / image.grid.shape[0]

    def mean(x, y, half=1.5):
        (i, j), n = image.grid.index((x, y, 0.0)) * scale, half / 0.08 * scale
        return grey[round(i - n) : round(i + n), round(j - n) : round(j + n)].mean()

    facing, far, flat = mean(4.5, 0), mean(-2, 0), mean(-9, 0)
    assert far + 40 < flat < facing - 15 and facing > 150  # of 255
    for y in (-6, 6):
        i, j = np.rint(image.grid.index((-8 + 0.375, y, 0.0)) * scale).astype(int)
        assert grey[i, j] == 255
    assert grey.mean() > 100  # no dark picture
    assert "(percentile 99.5 of the scene; the brightest pixel is 19.5 dB above)" in text["Description"]

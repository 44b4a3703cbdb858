"""A figure's picture says where its plots are, so that narrow pages stack them."""

import io
import json
import re
import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pytest
from PIL import Image

from companion.figures.stacked import KEY, png

sys.path.insert(0, str(Path(__file__).parents[3] / "book" / "extensions"))
import stacked as extension  # noqa: E402  # a Sphinx extension of the book


@pytest.fixture(scope="module")
def shared():
    """The picture of six plots that share their axes, below a legend."""
    figure = plt.figure(figsize=(9, 4), layout="constrained")
    plots = figure.subplots(2, 3, sharex=True, sharey=True)
    for plot in plots.flat:
        plot.plot([0, 1], [0, 1], label="a line")
        plot.set_title("a title")
    for plot in plots[:, 0]:
        plot.set_ylabel("action (-)")
    for plot in plots[-1]:
        plot.set_xlabel("time (s)")
    labels = plot.get_legend_handles_labels()
    figure.legend(*labels, loc="outside upper center", frameon=False)
    return picture_of(figure)


def picture_of(figure):
    plt.close(figure)
    return png(figure)


def places_in(picture):
    """The places that the picture of a figure tells."""
    return json.loads(Image.open(io.BytesIO(picture)).text[KEY])


def test_each_plot_is_a_row_with_the_labels_it_shares_and_all_is_held(shared):
    places = places_in(shared)
    # the upper plots get the labels below, all but the first of a row those to the left
    assert [len(row) for row in places["plots"]] == [1, 1, 2, 2, 2, 2, 1, 2, 2]
    for row, below in zip(places["plots"][:6:2], places["plots"][1:6:2], strict=True):
        assert sum(p[2] for p in row) == pytest.approx(sum(p[2] for p in below), abs=2)
    dark = np.asarray(Image.open(io.BytesIO(shared)).convert("RGB")).min(-1) < 128
    assert dark.any()
    for left, top, width, height in sum(places["plots"] + places["legend"], []):
        dark[top : top + height, left : left + width] = False
    assert not dark.any()


def test_a_bar_of_colours_stays_beside_its_plot_and_an_empty_plot_is_left_out():
    figure = plt.figure(figsize=(12, 3), layout="constrained")
    left, right, empty = figure.subplots(1, 3)
    for plot in (left, right):
        image = plot.imshow(np.eye(4))
    figure.colorbar(image, ax=right, label="height (m)")
    empty.set_axis_off()
    figure.suptitle("a title")
    places = places_in(picture_of(figure))
    (one,), (other,) = places["plots"]
    assert other[2] > 1.1 * one[2] and len(places["title"]) == 1


def test_pages_get_the_parts_of_figures_below_the_picture(shared, tmp_path):
    file = tmp_path / "figure.png"
    file.write_bytes(shared)
    tag = '<img alt="Lines &amp; more." src="../_images/figure.png" />'
    html = extension.stacked(tag, "../_images/figure.png", file)
    assert html.count("<svg") == 14 and 'aria-label="Lines &amp; more."' in html
    widths = [float(share) for share in re.findall(r"width:([\d.]+)%", html)]
    assert max(widths) == 100 and min(widths) > 5
    Image.new("RGB", (20, 10)).save(file)
    assert extension.stacked('<img src="a.png">', "a.png", file) == ""

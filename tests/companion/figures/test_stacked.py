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


def drawn(figure):
    """The picture of a figure as an array (H, W, 3), and the places in it."""
    plt.close(figure)
    with Image.open(io.BytesIO(png(figure))) as picture:
        return np.asarray(picture.convert("RGB")), json.loads(picture.text[KEY])


def shared(rows=2, columns=3):
    """A figure of plots that share their axes, as collected motion is shown."""
    figure = plt.figure(figsize=(9, 4), layout="constrained")
    plots = figure.subplots(rows, columns, sharex=True, sharey=True)
    for plot in plots.flat:
        plot.plot([0, 1], [0, 1], label="a line")
        plot.set_title("a title")
    for plot in plots[:, 0]:
        plot.set_ylabel("action (-)")
    for plot in plots[-1]:
        plot.set_xlabel("time (s)")
    labels = plot.get_legend_handles_labels()
    figure.legend(*labels, loc="outside upper center", frameon=False)
    return figure


def test_each_plot_is_a_row_with_the_labels_it_shares():
    _, places = drawn(shared())
    sizes = [len(row) for row in places["plots"]]
    # the upper plots get the labels below, all but the first of a row those to the left
    assert sizes == [1, 1, 2, 2, 2, 2, 1, 2, 2]
    for row, below in zip(places["plots"][:6:2], places["plots"][1:6:2], strict=True):
        assert sum(p[2] for p in row) == pytest.approx(sum(p[2] for p in below), abs=2)


def test_the_parts_hold_all_that_is_drawn():
    picture, places = drawn(shared())
    outside = (picture < 128).any(-1)
    for left, top, width, height in sum(places["plots"] + places["legend"], []):
        outside[top : top + height, left : left + width] = False
    assert (picture < 128).any() and not outside.any()


def test_a_bar_of_colours_stays_beside_its_plot_and_an_empty_plot_is_left_out():
    figure = plt.figure(figsize=(12, 3), layout="constrained")
    left, right, empty = figure.subplots(1, 3)
    for plot in (left, right):
        image = plot.imshow(np.eye(4))
    figure.colorbar(image, ax=right, label="height (m)")
    empty.set_axis_off()
    figure.suptitle("a title")
    _, places = drawn(figure)
    (one,), (other,) = places["plots"]
    assert other[2] > 1.1 * one[2]
    assert len(places["title"]) == 1


def test_pages_get_the_parts_below_the_picture(tmp_path):
    file = tmp_path / "figure.png"
    figure = shared()
    file.write_bytes(png(figure))
    plt.close(figure)
    tag = '<img alt="Lines &amp; more." src="../_images/figure.png" />'
    html = extension.stacked(tag, "../_images/figure.png", file)
    assert html.count("<svg") == 14 and html.count("<span") == 2
    assert 'aria-label="Lines &amp; more."' in html
    widths = [float(share) for share in re.findall(r"width:([\d.]+)%", html)]
    assert max(widths) == 100 and min(widths) > 5


def test_a_picture_that_is_no_figure_stays_as_it_is(tmp_path):
    file = tmp_path / "photograph.png"
    Image.new("RGB", (20, 10)).save(file)
    assert extension.stacked('<img src="a.png">', "a.png", file) == ""

"""Results for other pages are kept in the format of MyST-NB."""

import myst_nb
import pytest
from IPython.display import HTML
from IPython.utils.capture import capture_output

from companion.pages.page import glue


@pytest.mark.parametrize("thing", [HTML("<p>3</p>"), "text", 2.5])
def test_it_is_what_the_book_takes_over(thing, shell):
    with capture_output() as kept:
        glue("saving", thing)
        myst_nb.glue("saving", thing, display=False)
    output, expected = kept.outputs
    assert output.data == expected.data and output.metadata == expected.metadata
    assert output.metadata["scrapbook"]["name"] == "saving"

"""Results for other pages are kept as MyST-NB keeps them."""

import myst_nb
import pytest
from IPython.core.interactiveshell import InteractiveShell
from IPython.display import HTML
from IPython.utils.capture import capture_output

from companion.pages.glue import glue


@pytest.mark.parametrize("thing", [HTML("<p>3</p>"), "text", 2.5])
def test_it_is_what_the_book_takes_over(thing):
    InteractiveShell.instance()
    with capture_output() as kept:
        glue("saving", thing)
        myst_nb.glue("saving", thing, display=False)
    own, other = kept.outputs
    assert own.data == other.data and own.metadata == other.metadata
    assert own.metadata["scrapbook"]["name"] == "saving"

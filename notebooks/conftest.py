"""How pytest takes the notebooks (nbval).

Text on stderr, such as progress bars, is not compared.
"""


def pytest_collection_modifyitems(items):
    for notebook in {item.parent for item in items if item.path.suffix == ".ipynb"}:
        notebook.skip_compare += ("stderr",)

"""The Python of the page on one's own robot runs, with sizes of seconds."""

import re
import shutil

import pytest
from pages import ROOT, source

from ownrobot.fitting import settings

BLOCK = re.compile(r"^```python\n(.*?)^```", re.MULTILINE | re.DOTALL)

#: parts of the code and their replacements, which change sizes and nothing else
SMALLER = {
    r"minutes=\d+": "minutes=0.3",
    r'"max_samples": [\d_]+': '"max_samples": 4000',
    r"repeats=1\n\)": 'repeats=1, methods=["mean", "corrected"], shares=[1])',
}


@pytest.mark.more
def test_the_python_runs(tmp_path, monkeypatch, capsys):
    """Blocks run in the page's order: later ones use names of earlier ones."""
    text = source("notebooks/16-own-robot")
    code = "\n".join(BLOCK.findall(text))
    for words, smaller in SMALLER.items():
        code, count = re.subn(words, smaller, code)
        assert count, words
    for robot in ("warthog", "husky"):
        shutil.copy(ROOT / "recordings" / f"{robot}.csv.gz", tmp_path)
    shutil.copy(ROOT / "recordings" / "skid_steer.yaml", tmp_path / "robot.yaml")
    small = {"max_samples": 4000, "hidden": 16, "pixels": 8}
    monkeypatch.setattr(settings, "SETTINGS", settings.SETTINGS.with_values(small))
    monkeypatch.chdir(tmp_path)
    made = {}
    exec(code, made)  # noqa: S102 - the page's own
    assert re.match(r"loss [\d.]+ ± .* drives of", capsys.readouterr().out)
    assert made["path"].shape[1] == 13 and made["steps"].shape[0] > 1000
    assert made["info"] is not None and (tmp_path / "model").is_dir()

"""The check that `make portable` makes of a leg before its tests."""

import pytest
from portable import LEGS, Blunt, seen

HERE = {"level": "AVX2", "features": [], "libraries": ["NumPy", "OpenBLAS"]}


def test_a_setting_that_changes_nothing_is_a_fault():
    """One such setting takes away none of NumPy's features."""
    with pytest.raises(
        Blunt,
        match="NPY_DISABLE_CPU_FEATURES= changes none of NumPy's exp, "
        ".*: the leg could",
    ):
        seen(LEGS["sse"]._replace(settings={"NPY_DISABLE_CPU_FEATURES": "X86"}), HERE)


def test_what_cannot_be_lowered_here_is_left_out(capsys):
    assert seen(LEGS["avx2"], HERE) == {}
    lines = capsys.readouterr().out.splitlines()
    assert (
        "  OPENBLAS_CORETYPE: left out, this processor has nothing above AVX2" in lines
    )
    assert "  MKL_CBWR: left out, MKL is not in use here" in lines
    assert len(lines) == len(LEGS["avx2"].settings)

"""What the README and the examples say runs."""

import re
import runpy
import sys
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1]


def test_the_readme_runs(capsys: pytest.CaptureFixture[str]) -> None:
    code = re.findall(r"```python\n(.*?)```", (PACKAGE / "README.md").read_text(), flags=re.DOTALL)
    assert code
    for block in code:
        exec(compile(block, "README.md", "exec"), {})
    assert "count" in capsys.readouterr().out


def test_the_spectrum_example_runs(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    picture = tmp_path / "spectrum.png"
    monkeypatch.setattr(sys, "argv", ["spectrum.py", "--out", str(picture)])
    monkeypatch.setenv("MPLBACKEND", "agg")
    runpy.run_path(str(PACKAGE / "examples" / "spectrum.py"), run_name="__main__")
    said = capsys.readouterr().out
    assert "junctions" in said and "Estimate(" in said
    # Drawn where matplotlib is installed.
    assert picture.exists() == ("drawn to" in said)

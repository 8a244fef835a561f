"""The example notebook runs from its first cell to its last, and draws what it says."""

from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

from conftest import command

NOTEBOOK = Path(__file__).parents[4] / "examples" / "figures.ipynb"


@pytest.fixture(scope="module")
def paper_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The paper's cells and levels, two hits of a second each instead of eight of two."""
    folder = tmp_path_factory.mktemp("paper")
    plan, file = folder / "plan.toml", folder / "lab.jrig"
    command("plan", "new", plan, "--template", "paper")
    text = plan.read_text()
    for old, new in [
        ("\nwanted = 8", "\nwanted = 2"),
        ("\nminimum = 5", "\nminimum = 2"),
        ("length_s = 2.0", "length_s = 1.0"),
        ("exponential_per_s = 2.3", "exponential_per_s = 4.6"),
    ]:
        assert old in text, old
        text = text.replace(old, new)
    plan.write_text(text)
    command("campaign", "new", file, "--plan", plan)
    command("campaign", "run", file, "--device", "sim:", "--yes")
    command("shaker", file, "--device", "sim:", "--yes")
    return file


def test_the_notebook_runs_and_draws(paper_file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("JOINTRIG_CAMPAIGN", str(paper_file))
    notebook = nbformat.read(NOTEBOOK, 4)
    assert all(not cell.get("outputs") for cell in notebook.cells), "outputs are made, not kept"
    NotebookClient(notebook, timeout=300, kernel_name="python3").execute()
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    kinds = [kind for output in outputs for kind in output.get("data", {})]
    # the places, interface modes, three kinds of loops, specimens, the comparison; two figures of matplotlib
    assert kinds.count("image/svg+xml") == 7 and kinds.count("image/png") == 2
    told = "".join(output.get("text", "") for output in outputs)
    assert "inverse          6 modes" in told and "the FBS value is not k_T" in told

"""The example notebooks run, and what they show is a text, a picture, a bar."""

import os
from pathlib import Path

import pytest

NOTEBOOKS = sorted((Path(__file__).parents[2] / "examples" / "notebooks").glob("*.ipynb"))


@pytest.mark.docs(every=2)
@pytest.mark.filterwarnings("ignore")  # of the kernel's own machinery
@pytest.mark.parametrize("path", NOTEBOOKS, ids=[path.stem for path in NOTEBOOKS])
def test_a_notebook_runs(path, tmp_path, monkeypatch):
    import nbformat
    from nbclient import NotebookClient

    root = path.parents[2]
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(root), os.environ.get("PYTHONPATH", "")]))
    notebook = nbformat.read(path, as_version=4)
    assert not any(cell.get("outputs") for cell in notebook.cells), (
        "notebooks are kept without what they show"
    )
    NotebookClient(notebook, timeout=120, resources={"metadata": {"path": str(tmp_path)}}).execute()
    shown = [output for cell in notebook.cells for output in cell.get("outputs", ())]
    told = "".join(
        output.get("text", "") or output.get("data", {}).get("text/html", "") for output in shown
    )
    assert not [output for output in shown if output["output_type"] == "error"]
    if path.stem.startswith("01"):
        for word in ("--input force --output position", "STATISTICALLY ROBUST"):
            assert word in told, word
    else:
        pictures = [output for output in shown if "image/png" in output.get("data", {})]
        assert pictures
        assert "simulating 2 of 2" in told

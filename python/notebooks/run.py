"""Runs the notebooks and writes each, with its outputs, as a page: run.py OUTPUT [NOTEBOOK ...].

OUTPUT/NAME.md and its pictures NAME-1.png, ... With --check OUTPUT nothing is written, and the
page is compared with what the notebook says now; pictures are not compared.
"""

from __future__ import annotations

import argparse
import base64
import io
import os
import sys
from pathlib import Path

import nbformat
from nbclient import NotebookClient
from PIL import Image

HERE = Path(__file__).resolve().parent
SECONDS_PER_CELL = 600
# Of a picture: few, so that the pages stay small.
COLOURS = 160


def executed(path: Path) -> nbformat.NotebookNode:
    """Returns a notebook with the outputs of a run in its own folder."""
    notebook = nbformat.read(path, as_version=4)
    NotebookClient(
        notebook,
        timeout=SECONDS_PER_CELL,
        kernel_name="python3",
        resources={"metadata": {"path": str(HERE)}},
    ).execute()
    return notebook


def small(picture: bytes) -> bytes:
    """Returns a PNG with a palette."""
    out = io.BytesIO()
    image = Image.open(io.BytesIO(picture)).convert("RGB")
    image.quantize(COLOURS, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE).save(
        out, "PNG", optimize=True
    )
    return out.getvalue()


def page_of(name: str, notebook: nbformat.NotebookNode) -> tuple[str, list[bytes]]:
    """Returns the notebook as Markdown, and its pictures."""
    parts: list[str] = []
    pictures: list[bytes] = []
    for cell in notebook.cells:
        if cell.cell_type == "markdown":
            parts.append(cell.source)
            continue
        parts.append(f"```python\n{cell.source}\n```")
        for output in cell.outputs:
            data = output.get("data", {})
            if "image/png" in data:
                pictures.append(small(base64.b64decode(data["image/png"])))
                parts.append(f"![{name}, picture {len(pictures)}]({name}-{len(pictures)}.png)")
            elif text := (output.get("text") or data.get("text/plain")):
                parts.append(f"```text\n{text.rstrip()}\n```")
    source = f"Made by `make python-notebooks` from `python/notebooks/{name}.ipynb`."
    return "\n\n".join([*parts, source]) + "\n", pictures


def main() -> int:
    """Runs the notebooks; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true", help="compare, do not write")
    parser.add_argument("output", type=Path)
    parser.add_argument("notebooks", nargs="*", type=Path)
    arguments = parser.parse_args()
    os.environ["MPLBACKEND"] = "module://matplotlib_inline.backend_inline"
    code = 0
    for path in arguments.notebooks or sorted(HERE.glob("*.ipynb")):
        page, pictures = page_of(path.stem, executed(path))
        target = arguments.output / f"{path.stem}.md"
        if arguments.check:
            same = target.exists() and target.read_text() == page
            print(f"{'ok    ' if same else 'differs'} {target}")
            code |= not same
            continue
        arguments.output.mkdir(parents=True, exist_ok=True)
        target.write_text(page)
        for i, picture in enumerate(pictures, 1):
            (arguments.output / f"{path.stem}-{i}.png").write_bytes(picture)
        print(f"{target}: {len(pictures)} pictures")
    return code


if __name__ == "__main__":
    sys.exit(main())

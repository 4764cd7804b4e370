"""`affordant draw`: a task graph's text as Mermaid, Graphviz and pictures, all of them or none."""

from __future__ import annotations

import os
import tempfile
import warnings
from pathlib import Path

import networkx as nx

from comparisons.figures_graph import task_graph_figure
from comparisons.style import picture
from hierarchy import TaskGraph, TaskGraphError, mermaid
from hierarchy.drawing import dot, task_graph_picture
from hierarchy.text import load_graph, load_world
from worlds import UserError


def draw_graph(name: str, world: str | None, out: Path) -> tuple[Path, ...]:
    """Draw a task graph as Mermaid (.mmd), Graphviz (.dot), PNG and SVG files; return their paths.

    All four appear, or none; no file is replaced.

    Parameters
    ----------
    name
        A graph's name or the path of its text; the files take its last part.
    world
        The world's name. Defaults to the one that the text names.
    out
        The folder of the files; it is made if it is not there.

    Raises
    ------
    UserError
        If the graph cannot be read or drawn, a file exists, or the folder cannot be written to.
    """
    graph, _ = load_graph(name, None if world is None else load_world(world))
    _refuse_rings(graph)
    stem = Path(name).stem
    paths = [out / f"{stem}.{kind}" for kind in ("mmd", "dot", "png", "svg")]
    _refuse_existing(paths)
    with warnings.catch_warnings():
        # Letters that the font lacks are drawn as empty boxes; the Mermaid and Graphviz files have them.
        warnings.filterwarnings("ignore", "Glyph .* missing from font")
        drawn = picture(task_graph_figure(task_graph_picture(graph)))
    contents = [mermaid(graph).encode(), dot(graph).encode(), drawn.png, drawn.svg.encode()]
    _write_all(out, dict(zip(paths, contents, strict=True)))
    return tuple(paths)


def _refuse_rings(graph: TaskGraph) -> None:
    for cycle in nx.simple_cycles(nx.DiGraph(graph.networkx())):
        ring = " -> ".join((*cycle, cycle[0]))
        raise TaskGraphError(
            f"task graph {graph.name} cannot be drawn: tasks call each other in a ring, {ring}; "
            "remove one of its edges"
        )


def _refuse_existing(paths: list[Path]) -> None:
    for path in paths:
        if path.exists() or path.is_symlink():
            raise UserError(f"{path}: it exists already; name another folder with --out, or remove it")


def _write_all(folder: Path, contents: dict[Path, bytes]) -> None:
    """Write files that take their names only once all of them are complete."""
    made: list[Path] = []
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=".draw-", dir=folder) as hidden:
            for path, content in contents.items():
                (Path(hidden) / path.name).write_bytes(content)
            for path in contents:
                os.link(Path(hidden) / path.name, path)  # unlike a renaming, this never replaces a file
                made.append(path)
    except OSError as error:
        for path in made:
            path.unlink(missing_ok=True)
        problem = f"the drawings cannot be written ({error.strerror}: {error.filename2 or error.filename})"
        raise UserError(f"--out {folder}: {problem}; name another place") from error

"""`affordant maze`: a layout drawn from a seed, as the text that every other command reads."""

from __future__ import annotations

from pathlib import Path

from worlds import UserError
from worlds.generate import generate_layout
from worlds.layout_writing import layout_text


def draw_maze(
    out: Path | None,
    rows: int,
    cols: int,
    seed: int,
    *,
    rooms: tuple[int, int] = (1, 2),
    doors: int = 2,
    triggers: int = 4,
    goals: int = 4,
    obstacles: int = 6,
) -> str:
    """Draw a maze; return its text, or its path if it was written to a file.

    Parameters
    ----------
    out
        The file to write; it must not exist. None writes nothing.
    rows, cols, seed, rooms, doors, triggers, goals, obstacles
        As `worlds.generate.generate_layout` has them.

    Raises
    ------
    UserError
        If the maze is too small for what it is to hold, or the file cannot be written.

    Examples
    --------
    >>> print(draw_maze(None, 2, 4, 1, doors=1, triggers=1, goals=1, obstacles=0), end="")
    name maze_2x4_1
    <BLANKLINE>
    grid
    .   .  :  D1  .
    T1  .  |  .   G1
    <BLANKLINE>
    start 0,1
    trigger T1
    goal G1
    """
    layout = generate_layout(
        rows, cols, seed, rooms=rooms, doors=doors, triggers=triggers, goals=goals, obstacles=obstacles
    )
    text = layout_text(layout)
    if out is None:
        return text
    try:
        with out.open("x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError:
        raise UserError(f"--out {out}: it exists already; name another file, or remove it") from None
    except OSError as error:
        raise UserError(
            f"--out {out}: it cannot be written ({error.strerror}); name another place"
        ) from error
    return f"{out}\n"

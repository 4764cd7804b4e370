"""Where episodes begin, in words: a predicate that chooses among a world's starts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hierarchy.grounding import GroundGraph
from hierarchy.terms import Var
from hierarchy.text_predicates import parse_predicate
from hierarchy.text_words import Scope
from worlds import UserError


def beginning_where(grounded: GroundGraph, text: str) -> GroundGraph:
    """Return a ground graph whose world begins only where a predicate holds; else it is as it was.

    Parameters
    ----------
    grounded
        The ground graph.
    text
        A predicate over the world's state variables, such as ``goal = 7,9 and robot in {1,1, 1,2}``.

    Raises
    ------
    PredicateError
        If the text is no predicate; the message gives the column and a mend.
    UserError
        If it holds in no start.

    Examples
    --------
    >>> from hierarchy import ground, two_rooms
    >>> from worlds import load_layout, maze_model
    >>> maze = load_layout("two_rooms")
    >>> grounded = ground(two_rooms(maze), maze_model(maze))
    >>> int(grounded.model.starts.sum()), int(beginning_where(grounded, "goal = G2").model.starts.sum())
    (496, 124)
    """
    model = grounded.model
    scope = Scope({variable.name: Var(variable) for variable in model.index.variables})
    starts = model.starts & parse_predicate(text, scope).mask(model.index)
    if not np.any(starts):
        raise UserError(f"no start has {text!r}; choose among the world's {int(model.starts.sum())} starts")
    return replace(grounded, model=model.beginning(starts))

"""Dietterich's task graph of Taxi (2000, figure 2)."""

from __future__ import annotations

from hierarchy.graph import Call, TaskGraph
from hierarchy.terms import Param
from worlds import TransitionModel
from worlds.taxi import ABOARD, DELIVERED, SITES


def taxi_graph(model: TransitionModel) -> TaskGraph:
    """Return Root -> Get, Put -> Navigate(site), Pickup, Putdown -> North, South, East, West.

    Get works while the passenger waits at a site and ends with him aboard; Put works while he is aboard
    and ends with him delivered. Relevant variables are Dietterich's (section 5.1.6): a completion after
    Navigate does not depend on where the taxi was, since Navigate ends at its site.

    Parameters
    ----------
    model
        `worlds.taxi.taxi_model` or `worlds.gym_model.gym_model` of Gymnasium's Taxi; with a fickle
        passenger, his `mind` matters to Root and Put as well.

    Examples
    --------
    >>> from hierarchy import check
    >>> from worlds.taxi import taxi_model
    >>> model = taxi_model()
    >>> graph = taxi_graph(model)
    >>> for call in graph.tasks["Put"].do:
    ...     print(call)
    Navigate(site=destination)
    Putdown
    >>> check(graph, model)
    ()
    """
    graph = TaskGraph("taxi", model.index.variables, model.actions)
    taxi, passenger, destination, *mind = graph.variables
    site = Param.over("site", SITES)
    waiting = passenger.isin(SITES.values())
    navigate = graph.task("Navigate", site, until=taxi.eq(site), uses=[taxi], do="North South East West")
    get = graph.task(
        "Get",
        until=passenger.eq(ABOARD),
        within=waiting,
        uses=[taxi, passenger],
        do=[navigate(site=passenger).using(passenger), "Pickup"],  # while he waits, his value is a site
    )
    put = graph.task(
        "Put",
        until=passenger.eq(DELIVERED),
        within=passenger.eq(ABOARD),
        uses=[taxi, passenger, destination, *mind],
        do=[
            navigate(site=destination).using(destination, *mind),
            Call("Putdown").using(taxi, destination, *mind),
        ],
    )
    graph.task(
        "Root",
        until=passenger.eq(DELIVERED),
        uses=[taxi, passenger, destination, *mind],
        do=[get().using(passenger, destination, *mind), put().using()],  # Put ends the root: no completion
    )
    return graph

"""The kernels of `MazeBatch`: a step of all mazes, and a reset of some.

Arrays are passed on as pointers, which cost no reference counts: `state` has `FIELDS` numbers a maze,
`grid` a byte a cell with what stands there (0, `CUBE` or `SPHERE`) and a row of cells before and after,
`slots` `SLOT` numbers an obstacle, `due` a number an obstacle. A stride of 0 shares one row among all mazes.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from worlds.batch_tables import AT, CELL, EVENT, KIND, SLOT, STEP
from worlds.jit import below, bits, kernel, moved, pointer, uniform

ROBOT, TRIGGER, GOAL, OPEN, STEPS, ALARM, EPISODE, ENDED = range(8)
"""A maze's state: the robot's cell, its marks' places, doors, steps, the step by which to look for
obstacles that appear, the number of its next episode, and whether this one is over."""
FIELDS: Final = 8
VIEW: Final = 8
"""Numbers in an observation."""
CUBE, SPHERE = 2, 3
DISABLED, SAME_STEP, NEXT_STEP = range(3)
"""When a maze whose episode is over is reset: never by itself, at once, or in place of its next step."""
PENDING, SETTLED = -1, -2
"""What `due` says of an obstacle whose time has not come, and of one that has appeared; otherwise the
step at which its time came."""
NEVER: Final = 2**31 - 1
CELLS, COLS, MOST, DRAWN, TRIGGERS, GOALS, STARTS, FREE, GRID_STRIDE, SLOT_STRIDE, DUE_STRIDE, LIMIT = range(
    12
)
"""Where `numbers` holds the maze's sizes, the arrays' strides, and the length at which an episode is cut."""
_MAZES: Final = (
    "Tuple((int32[:, ::1], uint8[:, ::1], int32[:, :, ::1], int32[:, ::1], int64[::1], uint8[:, ::1], "
    "uint8[::1], uint8[::1], int32[::1], int32[::1], int32[::1], int32[::1], int32[::1], int32[:, ::1], "
    "int32[:, ::1], int32[::1], int32[::1]))"
)
"""What both kernels take of a batch: its state, what the tables say, and room to work in."""
_START, _STEP, _ROBOT, _DOORS = range(4)
_ON_THE_WAY: Final = 0.75
_FARTHEST: Final = 3
"""As in `worlds.appearing`, which a test holds them to."""


@kernel(cached=False, forceinline=True)
def _towards(action: Any, cols: Any) -> Any:
    """Return the difference between the numbers of a cell and the next one in a direction."""
    return ((action & 1) * 2 - 1) * (cols if action < 2 else 1)


@kernel(cached=False)
def _push(shut: Any, grid: Any, sphere: Any, action: Any, cols: Any) -> Any:
    """Roll a sphere, `worlds.roll`; return whether it moved."""
    by = _towards(action, cols)
    cell = sphere
    while (shut[cell] >> action) & 1 == 0 and grid[cell + by] == 0:
        cell += by
    if cell == sphere:
        return False
    grid[sphere], grid[cell] = 0, SPHERE
    return True


@kernel(cached=False, forceinline=True)
def _comes(slot: Any, s: Any, opened: Any, moved_: Any) -> Any:
    """Return whether an obstacle's time has come."""
    event = slot[EVENT]
    if event == _STEP:
        return s[STEPS] >= slot[STEP]
    if event == _ROBOT:
        return slot[AT] == s[ROBOT] and (moved_ or s[STEPS] == 0)
    if event == _DOORS:
        return opened
    return s[STEPS] == 0


@kernel(cached=False)
def _appear(s: Any, opened: Any, moved_: Any, mine: Any, most: Any, doorways: Any) -> None:  # noqa: PLR0917 - arrays, one by one
    """Place every obstacle whose time has come and whose cell is free: `worlds.Episode`.

    Of two that wait for one cell, the one whose time came first goes first, then the one declared first.
    """
    grid, slots, due = mine
    alarm = NEVER
    for k in range(most):
        slot = moved(slots, k * SLOT)
        if due[k] == PENDING and _comes(slot, s, opened, moved_):
            due[k] = s[STEPS]
        if due[k] == PENDING and slot[EVENT] == _STEP:
            alarm = min(alarm, slot[STEP])
        if due[k] < 0:
            continue
        cell = slot[CELL]
        free = cell != s[ROBOT] and grid[cell] == 0 and (s[OPEN] != 0 or doorways[cell] == 0)
        for other in range(k + 1, most):
            first = due[other] >= 0 and due[other] < due[k]
            if first and slots[other * SLOT + CELL] == cell:
                free = False
        if free:
            grid[cell] = CUBE + slot[KIND]
            due[k] = SETTLED
        else:
            alarm = 0  # look again at every step
    s[ALARM] = alarm


@kernel(cached=False, forceinline=True)
def _advance(s: Any, action: Any, now: Any, grid: Any, cols: Any, triggers: Any) -> Any:  # noqa: PLR0917 - arrays
    """Carry out an action, `worlds.step`; return whether the robot moved and whether the doors opened."""
    robot = np.int64(s[ROBOT])
    to = robot + _towards(action, cols)
    moves = (now[robot] >> action) & 1 == 0
    if moves and grid[to] != 0:
        moves = grid[to] == SPHERE and _push(now, grid, to, action, cols)
    robot = to if moves else robot
    opened = s[OPEN] == 0 and robot == triggers[s[TRIGGER]]
    s[ROBOT] = robot
    s[OPEN] |= np.int32(opened)
    s[STEPS] += 1
    return moves, opened


@kernel(cached=False, forceinline=True)
def _look(s: Any, shut: Any, grid: Any, cols: Any, out: Any) -> None:
    """Write an observation: robot, trigger, goal, doors, and what is North, South, West and East."""
    robot = s[ROBOT]
    stops = shut[robot]
    out[0], out[1], out[2], out[3] = robot, s[TRIGGER], s[GOAL], s[OPEN]
    north, south, west, east = grid[robot - cols], grid[robot + cols], grid[robot - 1], grid[robot + 1]
    out[4] = 1 if stops & 1 else north
    out[5] = 1 if stops & 2 else south
    out[6] = 1 if stops & 4 else west
    out[7] = 1 if stops & 8 else east


@kernel(cached=False, forceinline=True)
def _mask(view: Any, shut: Any, grid: Any, cols: Any, out: Any) -> None:
    """Write 1 for each action that would move a robot with this view, 0 for the others."""
    for action in range(4):
        beside = view[4 + action]
        out[action] = beside == 0
        if beside == SPHERE:
            by = _towards(action, cols)
            to = view[0] + by
            out[action] = (shut[to] >> action) & 1 == 0 and grid[to + by] == 0


@kernel(cached=False)
def _nth_free(number: Any, free: Any, taken: Any, kept: Any) -> Any:
    """Return the n-th free cell that is not among the first `kept` of `taken`, ascending and distinct."""
    # Each cell taken before the one we want moves it on by one.
    place = number
    for k in range(kept):
        if free[place] >= taken[k]:
            place += 1
    return free[place]


@kernel(cached=False)
def _take(cell: Any, taken: Any, kept: Any) -> Any:
    """Put a cell among those taken, in order, unless it is there; return how many there are."""
    at = kept
    while at > 0 and taken[at - 1] >= cell:
        at -= 1
    if at < kept and taken[at] == cell:
        return kept
    for k in range(kept, at, -1):
        taken[k] = taken[k - 1]
    taken[at] = cell
    return kept + 1


@kernel(cached=False, forceinline=True)
def _is_taken(cell: Any, taken: Any, kept: Any) -> Any:
    """Return 1 if a cell is among those taken, 0 otherwise."""
    at = 0
    while at < kept and taken[at] < cell:
        at += 1
    return np.int64(at < kept and taken[at] == cell)


@kernel(cached=False)
def _draw_obstacles(  # noqa: PLR0917 - arrays, one by one
    key: Any,
    counter: Any,
    ends: Any,
    nexts: Any,
    free: Any,
    free_cells: Any,
    slots: Any,
    due: Any,
    most: Any,
    scratch: Any,
    way: Any,
) -> None:
    """Draw an episode's obstacles: `worlds.appearing.random_obstacles`, draw for draw."""
    start, trigger, goal = ends
    to_trigger, to_goal = nexts
    kept = _take(goal, scratch, _take(trigger, scratch, _take(start, scratch, 0)))
    way[0] = start
    length = 1
    while way[length - 1] != trigger:
        way[length] = to_trigger[way[length - 1]]
        length += 1
    while way[length - 1] != goal:
        way[length] = to_goal[way[length - 1]]
        length += 1
    counter += 1
    count = 1 + below(key, counter, most)
    for k in range(most):
        due[k] = PENDING if k < count else SETTLED
    for k in range(count):
        kind = below(key, counter + 1, 2)
        on_the_way = uniform(key, counter + 4) < _ON_THE_WAY  # 2 and 3 are size and colour
        counter += 5
        spots = 0
        for spot in range(1, length):
            spots += 1 - _is_taken(way[spot], scratch, kept)
        if on_the_way and spots > 0:
            left = below(key, counter, spots)
            spot = 0
            while left >= 0:
                spot += 1
                left -= 1 - _is_taken(way[spot], scratch, kept)
            cell: Any = way[spot]
            first = max(0, spot - _FARTHEST)
            choices: Any = 0
            for step in range(first, spot):
                choices += np.int64(way[step] != cell)
            counter += 1
            left = below(key, counter, choices)
            when: Any = first - 1
            while left >= 0:
                when += 1
                left -= np.int64(way[when] != cell)
        else:
            cell = _nth_free(below(key, counter, free_cells - kept), free, scratch, kept)
            counter += 1
            when = below(key, counter, length + 1)
        kept = _take(cell, scratch, kept)
        slot = moved(slots, k * SLOT)
        slot[CELL], slot[KIND], slot[EVENT], slot[STEP], slot[AT] = cell, kind, _STEP, when, -1


@kernel(cached=False)
def _begin(s: Any, key: Any, wanted: Any, numbers: Any, world: Any, mine: Any) -> None:  # noqa: PLR0917 - arrays, one by one
    """Begin a maze's next episode: draw what `wanted` leaves open, in the order of `MazeEnv`."""
    doorways, triggers, goals, starts, seats, free, to_trigger, to_goal = world
    grid, slots, due, scratch, way = mine
    cells, most = numbers[CELLS], numbers[MOST]
    key = bits(key + np.uint64(s[EPISODE]), 1)
    counter = 0
    trigger: Any = np.int64(wanted[0])
    goal, start = np.int64(wanted[1]), np.int64(wanted[2])
    if trigger < 0:
        choices: Any = 0
        for k in range(numbers[TRIGGERS]):
            choices += np.int64(triggers[k] != start)
        counter += 1
        left = below(key, counter, choices)
        while left >= 0:
            trigger += 1
            left -= np.int64(triggers[trigger] != start)
    if goal < 0:
        counter += 1
        goal = below(key, counter, numbers[GOALS])
    if start < 0:
        counter += 1
        seat = below(key, counter, numbers[STARTS] - 1)
        start = np.int64(starts[seat + np.int64(seat >= seats[trigger])])
    s[ROBOT], s[TRIGGER], s[GOAL], s[OPEN], s[STEPS], s[ENDED] = start, trigger, goal, 0, 0, 0
    s[EPISODE] += 1
    s[ALARM] = NEVER
    if most == 0:
        return
    for cell in range(cells):
        grid[cell] = 0
    if numbers[DRAWN] != 0:
        ends = (start, np.int64(triggers[trigger]), np.int64(goals[goal]))
        nexts = (moved(to_trigger, trigger * cells), moved(to_goal, goal * cells))
        _draw_obstacles(key, counter, ends, nexts, free, numbers[FREE], slots, due, most, scratch, way)
    else:
        for k in range(most):
            due[k] = PENDING
    _appear(s, False, False, (grid, slots, due), most, doorways)


@kernel(forceinline=True, cached=False)
def _pointers(mazes: Any) -> Any:
    """Return pointers to the arrays: those that change, those that are looked up, room to work in."""
    state, grid, slots, due, numbers, shut, doorways, traps = mazes[:8]
    triggers, goals, starts, seats, free, to_trigger, to_goal, scratch, way = mazes[8:]
    marks = (pointer(triggers), pointer(goals), pointer(starts), pointer(seats))
    ways = (pointer(free), pointer(to_trigger), pointer(to_goal))
    return (
        (pointer(state), pointer(grid), pointer(slots), pointer(due)),
        (pointer(numbers), pointer(shut), pointer(traps)),
        (pointer(doorways), *marks, *ways),
        (pointer(scratch), pointer(way)),
    )


@kernel(f"void(boolean[::1], uint64[::1], int32[::1], {_MAZES}, int8[:, ::1], int32[:, ::1])")
def reset(chosen: Any, keys: Any, wanted_: Any, mazes: Any, masks_: Any, views_: Any) -> None:  # noqa: PLR0917 - arrays
    """Begin episodes of the mazes that are chosen, and write what all of them see."""
    (state, grid, slots, due), (numbers, shut, _), world, room = _pointers(mazes)
    wanted, views, masks = pointer(wanted_), pointer(views_), pointer(masks_)
    cols = numbers[COLS]
    for i in range(keys.size):
        s, g = moved(state, FIELDS * i), moved(grid, numbers[GRID_STRIDE] * i + cols)
        if chosen[i]:
            own = moved(slots, numbers[SLOT_STRIDE] * i), moved(due, numbers[DUE_STRIDE] * i)
            _begin(s, keys[i], wanted, numbers, world, (g, *own, *room))
        now = moved(shut, numbers[CELLS] * s[OPEN])
        _look(s, now, g, cols, moved(views, VIEW * i))
        if masks_.size > 0:
            _mask(moved(views, VIEW * i), now, g, cols, moved(masks, 4 * i))


@kernel(
    f"int64(int64[::1], int64, uint64[::1], int32[::1], {_MAZES}, "
    "Tuple((int8[:, ::1], int32[:, ::1], float64[::1], uint8[:, ::1], int64[::1], int32[:, ::1], "
    "int8[:, ::1])))"
)
def step(  # noqa: C901, PLR0917 - one loop is fast; arrays, one by one
    actions_: Any, mode: Any, keys: Any, wanted_: Any, mazes: Any, out: Any
) -> Any:
    """Carry out an action in each maze, and reset as `mode` says.

    Returns
    -------
    int
        How many episodes ended, which the first of `ended` name; or, where an action is none, -1 less the
        place of the first such, and nothing has moved.
    """
    (state, grid, slots, due), (numbers, shut, traps), world, room = _pointers(mazes)
    doorways, triggers, goals = world[0], world[1], world[2]
    masks_, views_, rewards_, over_, ended, last_views_, last_masks_ = out
    actions, wanted, views, masks = pointer(actions_), pointer(wanted_), pointer(views_), pointer(masks_)
    rewards, terminated = pointer(rewards_), pointer(over_)
    last_views, last_masks = pointer(last_views_), pointer(last_masks_)
    cells, cols, most, limit = numbers[CELLS], numbers[COLS], numbers[MOST], numbers[LIMIT]
    masked = masks_.size > 0
    count = keys.size
    truncated = moved(terminated, count)
    wrong = np.int64(0)
    for i in range(count):
        wrong |= actions[i]
    if wrong < 0 or wrong > 3:
        i = 0
        while 0 <= actions[i] <= 3:
            i += 1
        return -1 - i
    ends = 0
    for i in range(count):
        s, g = moved(state, FIELDS * i), moved(grid, numbers[GRID_STRIDE] * i + cols)
        rewards[i], terminated[i], truncated[i] = -1.0, 0, 0
        if mode == NEXT_STEP and s[ENDED] != 0:
            rewards[i] = 0.0
            own = moved(slots, numbers[SLOT_STRIDE] * i), moved(due, numbers[DUE_STRIDE] * i)
            _begin(s, keys[i], wanted, numbers, world, (g, *own, *room))
        else:
            now = moved(shut, cells * s[OPEN])
            moves, opened = _advance(s, actions[i], now, g, cols, triggers)
            if most > 0 and (s[STEPS] >= s[ALARM] or opened or (moves and traps[s[ROBOT]] != 0)):
                own = moved(slots, numbers[SLOT_STRIDE] * i), moved(due, numbers[DUE_STRIDE] * i)
                _appear(s, opened, moves, (g, *own), most, doorways)
            reached = s[OPEN] != 0 and s[ROBOT] == goals[s[GOAL]]
            if reached or s[STEPS] >= limit:
                terminated[i], truncated[i] = reached, not reached
                s[ENDED] = 1
                if mode == SAME_STEP:
                    now = moved(shut, cells * s[OPEN])
                    _look(s, now, g, cols, moved(last_views, (VIEW + 1) * ends))
                    last_views[(VIEW + 1) * ends + VIEW] = s[STEPS]
                    if masked:
                        _mask(moved(last_views, (VIEW + 1) * ends), now, g, cols, moved(last_masks, 4 * ends))
                    own = moved(slots, numbers[SLOT_STRIDE] * i), moved(due, numbers[DUE_STRIDE] * i)
                    _begin(s, keys[i], wanted, numbers, world, (g, *own, *room))
                ended[ends] = i
                ends += 1
        now = moved(shut, cells * s[OPEN])
        _look(s, now, g, cols, moved(views, VIEW * i))
        if masked:
            _mask(moved(views, VIEW * i), now, g, cols, moved(masks, 4 * i))
    return ends

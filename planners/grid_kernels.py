"""Distance fields of grids in machine code: searched anew, or repaired after a cell is blocked or freed.

Importing this module loads numba; `planners.grid` and `planners.repair` are the way in, and
`planners.grid` holds the readable searches that these kernels are held to.

All kernels work on `steps`, the field laid out in one row with a border (`planners.borders`), so
that no step needs a test of the grid's edge. An entry is the number of steps, `FAR`
where no way is known, or `BLOCKED`. `passages` is None, or for each entry the four bits (North, South,
West, East) of the steps that no wall stops. `width` is the length of a row, unsigned.
"""

# ruff: noqa: PLR0917 - a kernel takes its arrays one by one
from __future__ import annotations

from typing import Any, Final

import numpy as np

from worlds.jit import kernel, pointer

FAR: Final = np.int32(2**30)
BLOCKED: Final = np.int32(-1)
_LOST: Final = np.int32(-2)  # this less its old distance marks a cell that has lost its ways
_ALL: Final = np.uint64(15)
_ONE: Final = np.uint64(1)
_NONE: Final = np.uint64(0)
_THREE: Final = np.uint64(3)
MANY: Final = 2**40


@kernel()
def field(free: Any, goals: Any, passages: Any, steps: Any, queue: Any) -> Any:
    """Write every cell's distance to `steps`, -1 where it is blocked or cut off; return how many are reached.

    `free` is the grid, shape (rows, cols); `goals` holds places in `steps`; `queue` is room to work in.
    """
    rows, cols = free.shape
    width = steps.size // (rows + 2)
    steps[:width] = BLOCKED
    steps[(rows + 1) * width :] = BLOCKED
    for row in range(rows):
        here = steps[(row + 1) * width : (row + 2) * width]
        for col in range(cols):
            here[col] = FAR if free[row, col] else BLOCKED
        here[cols:] = BLOCKED
    reached = _search(steps, passages, np.uint64(width), goals, queue)
    for i in range(steps.size):
        steps[i] = BLOCKED if steps[i] == FAR else steps[i]
    return np.int64(reached)


@kernel()
def again(steps: Any, passages: Any, width: Any, goals: Any, queue: Any) -> Any:
    """Search a field anew whose blocked cells are marked; return how many cells are reached."""
    return np.int64(_anew(steps, passages, width, goals, queue))


@kernel()
def free_cell(steps: Any, passages: Any, width: Any, cell: Any, goal: Any, queue: Any, reached: Any) -> Any:
    """Free a blocked cell and repair the field; return how many cells are reached, `reached` before.

    Every cell that changes is visited once, as a search would visit it: this never costs more than one.
    Where cells are joined that were cut off, all are counted anew, which costs no more than to mark them
    for a search.
    """
    cell = np.uint64(cell)
    here = np.int32(0) if goal else np.int32(_least(steps, _ways(passages, cell), width, cell) + 1)
    steps[cell] = min(here, FAR)
    if here >= FAR:
        return np.int64(reached)
    joins = _furthest(steps, _ways(passages, cell), width, cell) == FAR
    queue[_NONE] = np.uint32(cell)
    _spread(steps, passages, width, queue, _ONE, here)
    if not joins:
        return np.int64(reached) + 1
    total = 0
    for i in range(steps.size):
        total += (steps[i] >= 0) & (steps[i] < FAR)
    return total


@kernel()
def block_cell(
    steps: Any,
    passages: Any,
    width: Any,
    cell: Any,
    goals: Any,
    queue: Any,
    lost: Any,
    reached: Any,
    share: Any,
    few: Any,
) -> Any:
    """Block a free cell and repair the field; return how many cells are reached, less `MANY` if by a search.

    After Ramalingam and Reps (1996), for steps that all cost one: first the cells are found, nearest first,
    that have lost every optimal first action; then they are reached again from the rest of the field.

    `lost` is room for what is known of the lost cells, a third each for their places, their old distances and
    their first new ones; `queue` has room for four cells for each. `reached` is the number of cells reached
    before. The field is searched anew if more than a `share` of those are lost, or the room is used up, or
    when a search may cost little: see `_lose`.
    """
    cell = np.uint64(cell)
    old = steps[cell]
    steps[cell] = BLOCKED
    if old == FAR:
        return np.int64(reached)
    most = min(np.uint64(lost.size) // _THREE, np.uint64(share * reached))
    count = _lose(steps, passages, width, cell, queue, lost, old, most, np.uint64(few))
    if count > most:
        return np.int64(_anew(steps, passages, width, goals, queue)) - MANY
    cut = _regain(steps, passages, width, queue, lost, count) if count != _NONE else _NONE
    return np.int64(reached) - np.int64(cut) - 1


@kernel()
def first_actions(distance: Any, out: Any) -> None:
    """Write the set of optimal first actions of every cell to `out`, four bits each; walls left out.

    One pass for each action: the inner loops have no branch, so that they run on many cells at once.
    """
    rows, cols = distance.shape
    for row in range(rows):
        for col in range(cols):
            out[row, col] = 0
        if row > 0:
            for col in range(cols):
                out[row, col] |= np.uint8(_nearer(distance[row, col], distance[row - 1, col]))
        if row + 1 < rows:
            for col in range(cols):
                out[row, col] |= np.uint8(_nearer(distance[row, col], distance[row + 1, col]) << 1)
        for col in range(1, cols):
            out[row, col] |= np.uint8(_nearer(distance[row, col], distance[row, col - 1]) << 2)
        for col in range(cols - 1):
            out[row, col] |= np.uint8(_nearer(distance[row, col], distance[row, col + 1]) << 3)


@kernel(cached=False, forceinline=True)
def _nearer(here: Any, there: Any) -> Any:
    return np.uint8((here > 0) & (there == here - 1))


@kernel(cached=False, forceinline=True)
def _ways(passages: Any, cell: Any) -> Any:
    """Return the bits of the steps out of a cell that no wall stops; constant where there are no walls."""
    if passages is None:
        return _ALL
    return np.uint64(passages[cell])


@kernel(cached=False)
def _anew(steps: Any, passages: Any, width: Any, goals: Any, queue: Any) -> Any:
    """Search anew with the blocked cells that are marked; return how many cells are reached."""
    for i in range(steps.size):
        steps[i] = BLOCKED if steps[i] == BLOCKED else FAR
    return _search(steps, passages, width, goals, queue)


@kernel(cached=False)
def _search(steps: Any, passages: Any, width: Any, goals: Any, queue: Any) -> Any:
    """Search from all goals that are free; return how many cells are reached."""
    if queue.size < goals.size + 2:
        queue = np.empty(goals.size + 2, np.uint32)
    count = _NONE
    for i in range(goals.size):
        goal = np.uint64(goals[i])
        if steps[goal] == FAR:
            steps[goal] = 0
            queue[count] = np.uint32(goal)
            count += _ONE
    return _spread(steps, passages, width, queue, count, np.int32(0))


@kernel(cached=False)
def _spread(steps: Any, passages: Any, width: Any, queue: Any, count: Any, level: Any) -> Any:
    """Search on, level by level, from the first `count` cells of `queue`, whose steps are `level`.

    Lowers whatever is higher than it need be, and returns how many cells were visited. The queue has two
    halves, this level and the next, in turn. Whether a cell is new is hard to guess, so nothing branches on
    it: the cell is written to the end of the queue in any case, and the end moves on only if it is new.
    """
    room = np.uint64(queue.size) >> _ONE
    now, visited = _NONE, _NONE
    while count != _NONE:
        if np.uint64(4) * count > room:
            room = np.uint64(8) * count
            larger = np.empty(room + room, np.uint32)
            for i in range(count):
                larger[np.uint64(i)] = queue[now + np.uint64(i)]
            queue, now = larger, _NONE
        visited += count
        level += np.int32(1)
        start = room - now  # `now` is 0 or `room`
        end = start
        for i in range(now, np.uint64(now + count)):
            cell = np.uint64(queue[i])
            ways = _ways(passages, cell)
            end = _lower(steps, queue, end, cell - width, ways, level)
            end = _lower(steps, queue, end, cell - _ONE, ways >> np.uint64(2), level)
            end = _lower(steps, queue, end, cell + _ONE, ways >> _THREE, level)
            end = _lower(steps, queue, end, cell + width, ways >> _ONE, level)
        now, count = start, end - start
    return visited


@kernel(cached=False, forceinline=True)
def _lower(steps: Any, queue: Any, end: Any, cell: Any, way: Any, level: Any) -> Any:
    """Lower a cell to `level` if bit 0 of `way` leads to it and it is higher; return the queue's new end."""
    old = steps[cell]
    new = np.uint64(old > level) & way
    steps[cell] = level if new != _NONE else old
    queue[end] = np.uint32(cell)
    return end + new


@kernel(cached=False, forceinline=True)
def _least(steps: Any, ways: Any, width: Any, cell: Any) -> Any:
    """Return the fewest steps of a cell's neighbours, or `FAR`."""
    best = FAR
    here = steps[cell - width]
    best = here if (ways & _ONE) != _NONE and np.int32(0) <= here < best else best
    here = steps[cell + width]
    best = here if (ways & np.uint64(2)) != _NONE and np.int32(0) <= here < best else best
    here = steps[cell - _ONE]
    best = here if (ways & np.uint64(4)) != _NONE and np.int32(0) <= here < best else best
    here = steps[cell + _ONE]
    return here if (ways & np.uint64(8)) != _NONE and np.int32(0) <= here < best else best


@kernel(cached=False, forceinline=True)
def _furthest(steps: Any, ways: Any, width: Any, cell: Any) -> Any:
    """Return the most steps of a cell's neighbours."""
    most = steps[cell - width] if (ways & _ONE) != _NONE else BLOCKED
    most = max(most, steps[cell + width] if (ways & np.uint64(2)) != _NONE else BLOCKED)
    most = max(most, steps[cell - _ONE] if (ways & np.uint64(4)) != _NONE else BLOCKED)
    return max(most, steps[cell + _ONE] if (ways & np.uint64(8)) != _NONE else BLOCKED)


@kernel(cached=False, forceinline=True)
def _append(steps: Any, queue: Any, end: Any, cell: Any, ways: Any, width: Any, level: Any) -> Any:
    """Append the neighbours of a cell that are `level` steps away; return the new end of the queue."""
    queue[end] = np.uint32(cell - width)
    end += np.uint64(steps[cell - width] == level) & ways
    queue[end] = np.uint32(cell + width)
    end += np.uint64(steps[cell + width] == level) & (ways >> _ONE)
    queue[end] = np.uint32(cell - _ONE)
    end += np.uint64(steps[cell - _ONE] == level) & (ways >> np.uint64(2))
    queue[end] = np.uint32(cell + _ONE)
    return end + (np.uint64(steps[cell + _ONE] == level) & (ways >> np.uint64(3)))


@kernel(cached=False)
def _lose(
    steps_: Any, passages: Any, width: Any, cell: Any, queue_: Any, lost_: Any, old: Any, most: Any, few: Any
) -> Any:
    """Mark and list the cells all of whose shortest ways led through `cell`; return how many they are.

    The list comes nearest first, by the order of the queue. The count is above `most` if there are more, or
    if a search anew may cost little: it will not visit cells that nothing leads to any more. A neighbour that
    has kept another way shows that it will visit what has been lost until then; where `few` cells more than a
    quarter of those are lost and no other such neighbour is met, all else that is known of its cost is that
    it visits the cells on one way to `cell`.
    """
    steps, queue, lost = pointer(steps_), pointer(queue_), pointer(lost_)
    count, head, shown = _NONE, _NONE, _NONE
    few += np.uint64(old) >> np.uint64(2)
    end = _append(steps, queue, _NONE, cell, _ways(passages, cell), width, np.int32(old + 1))
    while head < end:
        cell = np.uint64(queue[head])
        head += _ONE
        here = steps[cell]
        ways = _ways(passages, cell)
        keeps = _least(steps, ways, width, cell) < here
        shown = count if keeps else shown
        if (here < 0) | keeps:
            continue
        if (count == most) | (count - shown > few + (shown >> np.uint64(2))):
            return most + _ONE
        steps[cell] = _LOST - here
        lost[count] = np.uint32(cell)
        count += _ONE
        end = _append(steps, queue, end, cell, ways, width, np.int32(here + 1))
    return count


@kernel(cached=False)
def _regain(steps_: Any, passages: Any, width: Any, queue_: Any, lost_: Any, count: Any) -> Any:
    """Reach the lost cells again, from those that are left and from each other; return how many are cut off.

    A cell that was `d` steps away and has a neighbour left is now `d + 1` or `d + 2` away by it, for its
    neighbours were at most one step further than it. So the cells to start from make two lists, `by_one`
    and `by_two`, that are in order as the cells were lost, and need no sorting.
    """
    steps, queue, lost = (
        pointer(steps_),
        pointer(queue_),
        pointer(lost_),
    )  # arrays would be counted at each call
    room = np.uint64(lost_.size) // _THREE
    by_one, one_end = room, room
    by_two, two_end = room + room, room + room
    for i in range(count):
        cell = np.uint64(lost[np.uint64(i)])
        best = _least(steps, _ways(passages, cell), width, cell)
        was = _LOST - steps[cell]
        lost[one_end] = np.uint32(cell)
        one_end += np.uint64(best == was)
        lost[two_end] = np.uint32(cell)
        two_end += np.uint64(best == was + 1)
    head, end = _NONE, _NONE
    level = np.int32(_LOST - steps[np.uint64(lost[_NONE])] + 1)
    while head < end or by_one < one_end or by_two < two_end:
        by_one, end = _take(steps, lost, by_one, one_end, queue, end, level, np.int32(1))
        by_two, end = _take(steps, lost, by_two, two_end, queue, end, level, np.int32(2))
        level += np.int32(1)
        stop = end
        while head < stop:
            cell = np.uint64(queue[head])
            head += _ONE
            ways = _ways(passages, cell)
            end = _reach(steps, queue, end, cell - width, ways, level)
            end = _reach(steps, queue, end, cell + width, ways >> _ONE, level)
            end = _reach(steps, queue, end, cell - _ONE, ways >> np.uint64(2), level)
            end = _reach(steps, queue, end, cell + _ONE, ways >> _THREE, level)
    if end == count:
        return _NONE
    for i in range(count):
        cell = np.uint64(lost[np.uint64(i)])
        steps[cell] = FAR if steps[cell] <= _LOST else steps[cell]
    return count - end


@kernel(cached=False, forceinline=True)
def _take(steps: Any, lost: Any, at: Any, stop: Any, queue: Any, end: Any, level: Any, more: Any) -> Any:
    """Give `level` to those next in the list that were `more` nearer and are still lost.

    Returns where the list goes on, and the queue's new end.
    """
    while at < stop:
        cell = np.uint64(lost[at])
        was = _LOST - steps[cell]
        if was + more > level:
            break
        at += _ONE
        if was + more == level:
            steps[cell] = level
            queue[end] = np.uint32(cell)
            end += _ONE
    return at, end


@kernel(cached=False, forceinline=True)
def _reach(steps: Any, queue: Any, end: Any, cell: Any, way: Any, level: Any) -> Any:
    """Give `level` to a lost cell if bit 0 of `way` leads to it; return the queue's new end."""
    old = steps[cell]
    new = np.uint64(old <= _LOST) & way
    steps[cell] = level if new != _NONE else old
    queue[end] = np.uint32(cell)
    return end + new

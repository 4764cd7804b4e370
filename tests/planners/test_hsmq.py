"""HSMQ held to values worked out by hand."""

import pytest
from learning_worlds import corridor, legs, two_exits

from hierarchy import TaskGraph, ground
from planners import HSMQ, LearningRate, Settings
from planners.learner import Step
from worlds import UserError

EXACT = Settings(rate=LearningRate(start=1.0, factor=1.0))


def test_a_child_backs_up_as_one_long_action() -> None:
    """Gamma = 1/2, three steps of -1 from 0, then V(Root, 3) = -8: -1 - 1/2 - 1/4 - 8/8, learnt by half."""
    grounded = legs(6, 3)
    root = grounded.root
    learner = HSMQ(grounded, (0,), Settings(gamma=0.5))
    learner.table[root][1][3] = -8.0
    learner._learn(root, 0, [Step(0, -1.0), Step(1, -1.0), Step(2, -1.0)], 3, 0.5)
    assert learner.q(root, 0, 0) == -2.75 / 2
    assert learner.table[root][0][1:3] == [0.0, 0.0]


def test_all_states_back_up_the_rewards_from_there_on() -> None:
    """Uneven rewards: from the third state -4 + V, from the second -2 before that, from the first -1."""
    grounded = legs(6, 3)
    root = grounded.root
    learner = HSMQ(grounded, (0,), Settings(gamma=0.5, all_states=True))
    learner.table[root][1][3] = -8.0
    learner._learn(root, 0, [Step(0, -1.0), Step(1, -2.0), Step(2, -4.0)], 3, 1.0)
    assert learner.table[root][0][:3] == [-1 - 0.5 * 6, -2 - 0.5 * 8, -4 - 0.5 * 8]


def test_the_last_step_is_learnt_and_nothing_beyond() -> None:
    """At the end a wrong value of the last step becomes its reward; the terminal state's is never read."""
    grounded = legs(4, 2)
    leg, root = grounded.place("Leg1"), grounded.root
    learner = HSMQ(grounded, (0,), EXACT)
    for task, k in ((leg, 0), (root, 1)):
        learner.table[task][k][2], learner.table[task][k][3] = -64.0, -1024.0
    learner.train(root, [2], episodes=1)
    assert learner.q(leg, 2, 0) == learner.q(root, 2, 1) == -1.0
    assert learner.value(leg, 3) == learner.value(root, 3) == 0.0


def test_a_task_goes_on_from_where_its_child_has_ended() -> None:
    """The child's terminal state is worth 0 to the child and -2 to the root."""
    grounded = legs(5, 2)
    learner = HSMQ(grounded, (0,), EXACT)
    learner.train(grounded.root, [0], episodes=5)
    first, root = grounded.place("Leg0"), grounded.root
    assert learner.value(first, 2) == 0.0
    assert (learner.value(first, 0), learner.value(root, 2), learner.value(root, 0)) == (-2.0, -2.0, -4.0)


def test_a_pseudo_reward_stays_within_its_task() -> None:
    """Out from 1 does not quit; taught or not, its callers count the real rewards on the way."""
    for pseudo_reward, steps in ((-30.0, 4), (None, 1)):
        grounded = two_exits(pseudo_reward=pseudo_reward)
        out, root = grounded.place("Out"), grounded.root
        learner = HSMQ(grounded, (0,))
        learner.train(root, [1, 2, 3, 4], episodes=1500)
        assert learner.greedy_steps(out, 1) == steps
        assert learner.greedy_steps(root, 1) == (4 if steps == 4 else 1 + 3 + 2)
    learner = HSMQ(two_exits(), (0,), EXACT)
    learner._learn(out, 0, [Step(1, -1.0)], 0, 1.0)
    learner._learn(root, 0, [Step(1, -1.0)], 0, 1.0)
    assert learner.q(out, 1, 0) == -31.0
    assert learner.q(root, 1, 0) == -1.0


def test_an_edge_s_own_variables_do_not_merge_values() -> None:
    """A completion may ignore where the child began, a whole value may not."""
    model = corridor(5, "right")
    graph = TaskGraph("one leg", model.index.variables, model.actions)
    (x,) = graph.variables
    leg = graph.task("Leg", until=x.eq(4), uses=[x], do="right")
    graph.task("Root", until=x.eq(4), uses=[x], do=[leg().using()])
    grounded = ground(graph, model)
    learner = HSMQ(grounded, (0,), EXACT)
    learner.train(grounded.root, range(4), episodes=40)
    assert [learner.value(grounded.root, at) for at in range(5)] == [-4.0, -3.0, -2.0, -1.0, 0.0]


def test_an_action_has_no_value_of_its_own() -> None:
    """Asking for one says so."""
    learner = HSMQ(legs(5, 2), (0,))
    with pytest.raises(UserError, match="stores no value of the primitive action right"):
        learner.value(0, 1)

from collections.abc import Callable, Iterator
from itertools import product
from typing import Any

import pytest
import torch
from option_runs import named
from tensordict import TensorDict, TensorDictBase
from tensordict.nn import TensorDictModule
from torch import Tensor, nn
from torchrl.objectives.utils import ValueEstimators

from planners.option_critic.choosing import of_option, upon_arrival
from planners.option_critic.loss import OptionCriticLoss
from planners.option_critic.networks import Actor, Critic, Terminations, called_tasks
from planners.option_critic.options import compile_options
from worlds import UserError
from worlds.torch_stream import generator

COLUMNS, OPTIONS, LEVELS, ACTIONS = 5, 4, 2, 3
ESTIMATORS = (ValueEstimators.TD0, ValueEstimators.TD1, ValueEstimators.TDLambda, ValueEstimators.GAE)


class _Plain(nn.Module):
    """A network of a user's, which knows of no options but their number."""

    def __init__(self, draw: torch.Generator, *shape: int) -> None:
        super().__init__()
        self.shape = shape
        size = int(torch.tensor(shape).prod())
        self.weight = nn.Parameter(torch.randn(COLUMNS, size, generator=draw, dtype=torch.float64))

    def forward(self, observation: Tensor) -> Tensor:
        return (observation @ self.weight).unflatten(-1, self.shape)


def _modules(seed: int = 0) -> tuple[TensorDictModule, TensorDictModule, TensorDictModule]:
    draw = generator(seed)
    shapes = {
        "option_logits": (OPTIONS, ACTIONS),
        "option_value": (OPTIONS,),
        "termination_logits": (OPTIONS, LEVELS),
    }
    actor, critic, ending = (
        TensorDictModule(_Plain(draw, *shape), ["observation"], [name]) for name, shape in shapes.items()
    )
    return actor, critic, ending


def _steps(seed: int = 0, number: int = 3, length: int = 6) -> TensorDictBase:
    """Return trajectories of random steps; some end, some are cut off, each next state leads to the next."""
    draw, batch = generator(seed, 7), (number, length)

    def mask(*shape: int, share: float = 0.6) -> Tensor:
        return torch.rand(*batch, *shape, generator=draw) < share

    seen = torch.randn(number, length, COLUMNS, generator=draw, dtype=torch.float64)
    after = torch.randn(number, length, COLUMNS, generator=draw, dtype=torch.float64)
    terminated, truncated = mask(1, share=0.2), mask(1, share=0.2)
    goes_on = ~(terminated | truncated)[:, :-1]
    after[:, :-1] = torch.where(goes_on, seen[:, 1:], after[:, :-1])
    option = torch.randint(OPTIONS, batch, generator=draw)
    permitted = mask(OPTIONS, ACTIONS)
    action = torch.randint(ACTIONS, batch, generator=draw)
    permitted[torch.arange(number)[:, None], torch.arange(length), option, action] = True
    following = {
        "observation": after,
        "initiation": mask(LEVELS, OPTIONS),
        "ended": mask(LEVELS),
        "reward": torch.randn(*batch, 1, generator=draw, dtype=torch.float64),
        "terminated": terminated,
        "truncated": truncated,
        "done": terminated | truncated,
    }
    return TensorDict(
        {
            "observation": seen,
            "option": option,
            "action": action,
            "action_log_prob": -torch.rand(*batch, generator=draw, dtype=torch.float64) - 0.5,
            "option_action_mask": permitted,
            "next": TensorDict(following, batch),
        },
        batch,
    )


def _loss(*, learnt: bool = True, **settings: Any) -> OptionCriticLoss:
    actor, critic, ending = _modules()
    loss = OptionCriticLoss(actor, critic, ending if learnt else None, **settings).double()
    loss.make_value_estimator(gamma=0.9)
    return loss


def _rows(found: Tensor) -> Iterator[tuple[int, int]]:
    return product(range(found.shape[0]), range(found.shape[1]))


@pytest.mark.parametrize("learnt", [False, True])
def test_advantages_go_by_the_worth_upon_arrival(learnt: bool) -> None:
    """GAE of Q(s, o) and U(s', o), summed step by step; nothing is carried past an end."""
    loss, steps = _loss(learnt=learnt, deliberation_cost=0.3), _steps()
    _, critic, ending = _modules()
    found = loss.advantages(steps.clone())
    with torch.no_grad():
        values, after = (critic(part.clone())["option_value"] for part in (steps, steps["next"]))
        logits = of_option(ending(steps["next"].clone())["termination_logits"], steps["option"])
    chances = steps["next", "ended"].double()
    if learnt:
        chances = logits.sigmoid()
    worth, ahead = upon_arrival(after, steps["option"], chances, steps["next", "initiation"], 0.3)
    assert torch.allclose(found["next", "ahead"], ahead)
    assert torch.allclose(found["next", "state_value"][..., 0], worth)
    for i in range(len(steps)):
        carried = 0.0
        for t in reversed(range(steps.shape[1])):
            step, own = steps[i, t], values[i, t, int(steps["option"][i, t])]
            alive = not step["next", "terminated"]
            error = step["next", "reward"] + 0.9 * alive * worth[i, t] - own
            carried = error + (0.9 * 0.95 * carried if not step["next", "done"] else 0.0)
            assert found["advantage"][i, t].item() == pytest.approx(float(carried))
            assert found["value_target"][i, t].item() == pytest.approx(float(carried + own))


@pytest.mark.parametrize(("kind", "lmbda"), [("GAE", 0.95), ("TD0", 0.0), ("TD1", 1.0), ("TDLambda", 0.95)])
def test_pseudo_rewards_teach_an_option_until_it_is_over(kind: str, lmbda: float) -> None:
    """Advantages take in those before the end, discounted as rewards are; values and targets none."""
    loss, steps = _loss(), _steps()
    loss.make_value_estimator(ValueEstimators[kind], gamma=0.9)
    plain = loss.advantages(steps.clone())
    draw = generator(5)
    steps["next", "pseudo_reward"] = -torch.rand(*steps.shape, 1, generator=draw, dtype=torch.float64)
    found = loss.advantages(steps)
    taught = found["advantage"] - plain["advantage"]
    for i in range(len(steps)):
        carried = 0.0
        for t in reversed(range(steps.shape[1])):
            after = steps[i, t]["next"]
            over = bool(after["done"]) or bool(after["ended"].any())
            carried = float(after["pseudo_reward"]) + (0.0 if over else 0.9 * lmbda * carried)
            assert taught[i, t].item() == pytest.approx(carried)
    assert torch.equal(found["value_target"], plain["value_target"])
    assert torch.equal(found["next", "state_value"], plain["next", "state_value"])


@pytest.mark.parametrize("kind", ESTIMATORS)
def test_any_estimator_writes_targets(kind: ValueEstimators) -> None:
    """Where the episode ends the target is the reward, one step ahead it is TD(0)'s; losses are finite."""
    loss, steps = _loss(), _steps()
    loss.make_value_estimator(kind, gamma=0.5)
    found = loss.advantages(steps)
    over = found["next", "terminated"]
    assert over.any()
    assert torch.allclose(found["value_target"][over], found["next", "reward"][over])
    if kind is ValueEstimators.TD0:
        wanted = found["next", "reward"] + 0.5 * ~over * found["next", "state_value"]
        assert torch.allclose(found["value_target"], wanted)
    assert torch.allclose(found["advantage"], found["value_target"] - found["state_value"])
    assert all(value.isfinite() for value in loss(found).values())


def test_other_estimators_are_refused() -> None:
    """The message lists those that are possible."""
    with pytest.raises(NotImplementedError, match=r"choose one of.*GAE"):
        _loss().make_value_estimator(ValueEstimators.VTrace)


def test_losses_by_hand() -> None:
    """Every term as its equation has it, row by row."""
    settings = {"clip_epsilon": 0.3, "entropy_coeff": 0.2, "critic_coeff": 0.7, "termination_coeff": 0.4}
    loss = _loss(prior_coeff=1.5, **settings)
    steps = loss.advantages(_steps())
    actor, critic, ending = _modules()
    with torch.no_grad():
        logits, values = actor(steps.clone())["option_logits"], critic(steps.clone())["option_value"]
        betas = ending(steps["next"].clone())["termination_logits"].sigmoid()
    advantage = steps["advantage"].squeeze(-1)
    scaled = (advantage - advantage.mean()) / advantage.std(correction=0)
    total = dict.fromkeys(("objective", "entropy", "critic", "termination"), 0.0)
    clips = 0
    for i, t in _rows(advantage):
        step, k = steps[i, t], int(steps["option"][i, t])
        odds = (logits[i, t, k].exp() * step["option_action_mask"][k]).tolist()
        chances = [x / sum(odds) for x in odds]
        ratio = chances[int(step["action"])] / float(step["action_log_prob"].exp())
        clips += not 0.7 <= ratio <= 1.3
        gain = float(scaled[i, t])
        total["objective"] -= min(ratio * gain, min(max(ratio, 0.7), 1.3) * gain)
        total["entropy"] += 0.2 * sum(p * float(torch.tensor(p).log()) for p in chances if p)
        error = abs(float(values[i, t, k] - step["value_target"]))
        total["critic"] += 0.7 * (0.5 * error**2 if error < 1 else error - 0.5)
        if not step["next", "terminated"]:
            for level in range(LEVELS):
                beta, ended = float(betas[i, t, k, level]), bool(step["next", "ended"][level])
                total["termination"] += 0.4 * beta * float(step["next", "ahead"][level])
                total["termination"] -= 1.5 * float(torch.tensor(beta if ended else 1 - beta).log())
    found = loss(steps)
    for name, value in total.items():
        assert found[f"loss_{name}"].item() == pytest.approx(value / advantage.numel(), abs=1e-4)
    assert float(found["clip_fraction"]) == pytest.approx(clips / advantage.numel())


def test_terminations_follow_theorem_2() -> None:
    """The gradient of their loss is minus that of the worth upon arrival, by finite differences."""
    loss, steps = _loss(termination_coeff=1.0, deliberation_cost=0.2), _steps()
    steps["next", "terminated"].fill_(False)
    loss.advantages(steps)
    loss(steps)["loss_termination"].backward()
    after, option = steps["next"], steps["option"]
    weight = loss.termination_network_params["module", "weight"]
    values = _modules()[1](after.clone())["option_value"].detach()

    def worth(shift: Tensor) -> float:
        logits = (after["observation"] @ (weight.detach() + shift)).unflatten(-1, (OPTIONS, LEVELS))
        chances = of_option(logits, option).sigmoid()
        return float(upon_arrival(values, option, chances, after["initiation"], 0.2)[0].mean())

    for place in product(range(COLUMNS), range(OPTIONS * LEVELS)):
        shift = torch.zeros_like(weight)
        shift[place] = 1e-5
        assert float(weight.grad[place]) == pytest.approx(-(worth(shift) - worth(-shift)) / 2e-5, abs=1e-8)


def test_where_the_episode_ends_terminations_have_no_say() -> None:
    """Neither their own loss nor the prior reaches them there."""
    loss, steps = _loss(prior_coeff=1.0), _steps()
    steps["next", "terminated"].fill_(True)
    loss(loss.advantages(steps))["loss_termination"].backward()
    assert (loss.termination_network_params["module", "weight"].grad == 0).all()


def test_the_prior_draws_terminations_to_the_graph() -> None:
    """Alone, it is least where they say what the graph says, and its gradient leads there."""
    loss, steps = _loss(prior_coeff=1.0, termination_coeff=0.0), _steps()
    loss.advantages(steps)
    optimiser = torch.optim.Adam(loss.parameters(), lr=0.05)
    before = loss(steps)["loss_termination"].item()
    for _ in range(300):
        optimiser.zero_grad()
        loss(steps)["loss_termination"].backward()
        optimiser.step()
    assert loss(steps)["loss_termination"].item() < before / 2


def test_the_policy_climbs() -> None:
    """A small step makes actions likelier that were better than expected, and others less likely."""
    loss, steps = _loss(entropy_coeff=0.0), _steps(number=1, length=2)
    steps["option"][:] = torch.tensor([[0, 1]])
    steps["option_action_mask"].fill_(True)
    steps["advantage"] = torch.tensor([[[1.0], [-1.0]]], dtype=torch.float64)
    steps["value_target"] = torch.zeros_like(steps["advantage"])
    steps["next", "ahead"] = torch.zeros(1, 2, LEVELS, dtype=torch.float64)

    def chances() -> list[float]:
        weight = loss.actor_network_params["module", "weight"].detach()
        logits = (steps["observation"] @ weight).unflatten(-1, (OPTIONS, ACTIONS))
        found = of_option(logits, steps["option"]).log_softmax(-1)
        return found.gather(-1, steps["action"][..., None]).flatten().tolist()

    before = chances()
    steps["action_log_prob"] = torch.tensor([before])
    loss(steps)["loss_objective"].backward()
    with torch.no_grad():
        for parameter in loss.parameters():
            if parameter.grad is not None:
                parameter.sub_(1e-3 * parameter.grad)
    better, worse = (new - old for new, old in zip(chances(), before, strict=True))
    assert better > 0 > worse


def test_each_part_learns_from_its_own_loss() -> None:
    """Every parameter gets a gradient from one loss and none from the others; targets and values none."""
    for name, part in {
        "objective": "actor",
        "entropy": "actor",
        "critic": "critic",
        "termination": "termination",
    }.items():
        loss = _loss()
        loss(loss.advantages(_steps()))[f"loss_{name}"].backward()
        for other in ("actor", "critic", "termination"):
            (parameter,) = getattr(loss, f"{other}_network_params").values(True, True)
            assert (parameter.grad is not None and bool(parameter.grad.any())) == (other == part)
            (target,) = getattr(loss, f"target_{other}_network_params").values(True, True)
            assert not target.requires_grad
    assert len(list(loss.parameters())) == 3


@pytest.mark.parametrize("learnt", [False, True])
def test_tensors_may_be_given_by_name(learnt: bool) -> None:
    """TorchRL's dispatch: keywords named as in_keys, results in the order of out_keys."""
    loss = _loss(learnt=learnt)
    steps = loss.advantages(_steps())
    wanted = loss(steps)
    named_tensors = {key if isinstance(key, str) else "_".join(key): steps[key] for key in loss.in_keys}
    found = loss(**named_tensors)
    assert set(wanted.keys()) == set(loss.out_keys)
    for key, value in zip(loss.out_keys, found, strict=True):
        assert torch.equal(value, wanted[key])


def test_in_keys_are_all_that_is_read() -> None:
    """The loss of rows that hold nothing else is the same."""
    loss = _loss()
    steps = loss.advantages(_steps())
    assert (loss(steps.select(*loss.in_keys)) == loss(steps)).all()
    for key in loss.in_keys:
        with pytest.raises(KeyError):
            loss(steps.select(*(other for other in loss.in_keys if other != key)))


def test_advantages_that_are_missing_are_worked_out() -> None:
    """Whole trajectories need no call before; they are left as they were."""
    loss, steps = _loss(), _steps()
    found = loss(steps)
    assert set(steps.keys(True)) == set(_steps().keys(True))
    assert (found == loss(loss.advantages(steps))).all()


@pytest.mark.parametrize("kind", ESTIMATORS)
def test_keys_may_be_renamed(kind: ValueEstimators) -> None:
    """Every key that is accepted, one nested; the losses and what is written stay the same."""
    loss, steps = _loss(), _steps()
    loss.make_value_estimator(kind, gamma=0.9)
    wanted = loss(loss.advantages(steps.clone()))
    names = {name: f"my_{name}" for name in vars(loss.tensor_keys)}
    names["ended"] = ("graph", "ended")  # type: ignore[assignment]
    renamed = steps.clone()
    for name, key in vars(loss.tensor_keys).items():
        for part in (renamed, renamed["next"]):
            if key in part:
                part.set(names[name], part.pop(key))
    loss.set_keys(**names)
    found = loss(loss.advantages(renamed))
    assert (found == wanted).all()
    assert {"my_advantage", "my_value_target", "my_value"} <= set(renamed.keys())
    assert not {"advantage", "value_target", "state_value"} & set(renamed.keys())
    assert "my_action" in loss.in_keys
    assert ("next", "graph", "ended") in loss.in_keys


@pytest.mark.parametrize(("reduction", "by"), [("sum", torch.sum), ("mean", torch.mean)])
def test_reductions(reduction: str, by: Callable[[Tensor], Tensor]) -> None:
    """Each row's loss is given with "none"; the others reduce them."""
    steps = _loss().advantages(_steps())
    rows, found = _loss(reduction="none")(steps), _loss(reduction=reduction)(steps)
    for name in ("loss_objective", "loss_entropy", "loss_critic", "loss_termination"):
        assert rows[name].squeeze(-1).shape == steps.shape
        assert torch.allclose(by(rows[name]), found[name])


def test_other_reductions_are_refused() -> None:
    """With the nearest word."""
    with pytest.raises(UserError, match="reduction: 'maen' is not possible; did you mean 'mean'"):
        _loss(reduction="maen")


def test_weights_come_back() -> None:
    """A state_dict taken to another loss gives the same losses."""
    first, steps = _loss(entropy_coeff=0.3), _steps()
    second = OptionCriticLoss(*_modules(seed=9)).double()
    second.make_value_estimator(gamma=0.9)
    first.advantages(steps)
    wanted, before = first(steps), second(steps)
    second.load_state_dict(first.state_dict())
    found = second(steps)
    for name in ("loss_objective", "loss_critic", "loss_termination", "loss_entropy"):
        assert not torch.equal(before[name], wanted[name])
        assert torch.equal(found[name], wanted[name])


@pytest.mark.parametrize("name", ["two_rooms", "taxi"])
def test_networks_that_give_one_option_change_no_loss(name: str) -> None:
    """What is computed of the running options alone is what all of them would have given."""
    options, draw = compile_options(named(name)), generator(5)
    count, levels = len(options), options.levels
    networks = [
        Actor(options, torch.ones(len(options.tasks), COLUMNS), 4, draw),
        Critic(options, torch.ones(len(options.parts), COLUMNS), 4, 1.0, draw),
        Terminations(options, torch.ones(len(called_tasks(options)), COLUMNS), 4, draw),
    ]
    keys = ("option_logits", "option_value", "termination_logits")
    found = []
    for wrap in (lambda network: network, nn.Sequential):
        pairs = zip(networks, keys, strict=True)
        modules = [TensorDictModule(wrap(network), ["observation"], [key]) for network, key in pairs]
        loss = OptionCriticLoss(*modules, prior_coeff=1.0).double()
        loss.make_value_estimator(gamma=0.9)
        draw = generator(6)
        steps = _steps()
        steps["option"] = torch.randint(count, steps.shape, generator=draw)
        steps["action"] = torch.randint(2, steps.shape, generator=draw)
        shape = (*steps.shape, count, options.actions.shape[2])
        steps["option_action_mask"] = torch.ones(shape, dtype=torch.bool)
        steps["next", "initiation"] = torch.rand(*steps.shape, levels, count, generator=draw) < 0.5
        steps["next", "ended"] = torch.rand(*steps.shape, levels, generator=draw) < 0.5
        found.append(loss(loss.advantages(steps)))
    for key, value in found[0].items():
        assert torch.allclose(value, found[1][key], atol=1e-9), key

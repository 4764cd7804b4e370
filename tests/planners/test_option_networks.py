import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from option_runs import named, sound_graphs
from torch import Tensor, nn

from hierarchy import GroundGraph
from planners.option_critic.networks import (
    Actor,
    Critic,
    SideBySide,
    Terminations,
    called_tasks,
    columns_of,
)
from planners.option_critic.options import NONE, Options, compile_options
from worlds.encoding import Encoding
from worlds.torch_stream import generator

Network = Actor | Critic | Terminations


def _sees(count: int, columns: int) -> Tensor:
    return torch.rand(count, columns, generator=generator(1)) < 0.5


def _networks(options: Options, columns: int = 7) -> list[Network]:
    """Return an actor, a critic and terminations whose outputs differ from one another."""
    draw = generator(2)
    found: list[Network] = [
        Actor(options, _sees(len(options.tasks), columns), 6, draw),
        Critic(options, _sees(len(options.parts), columns), 6, 3.0, draw),
        Terminations(options, _sees(len(called_tasks(options)), columns), 6, draw),
    ]
    for parameter in nn.ModuleList(found).parameters():
        parameter.data += torch.randn(parameter.shape, generator=draw)
    return [network.double() for network in found]


def test_networks_side_by_side_are_single_ones() -> None:
    """Each is an ordinary network of three layers of what it sees."""
    sees = _sees(3, 5)
    together = SideBySide(sees, 2, 4, generator(3))
    for bias in together.biases:
        bias.data += torch.randn(bias.shape, generator=generator(4))
    rows = torch.randn(6, 5, generator=generator(5))
    found = together(rows)
    for i in range(3):
        x = rows * sees[i]
        for layer, (weight, bias) in enumerate(zip(together.weights, together.biases, strict=True)):
            x = x @ weight[i] + bias[i]
            x = x.relu() if layer < 2 else x
        assert torch.allclose(found[:, i], x, atol=1e-6)


@settings(max_examples=25, deadline=None)
@given(st.sampled_from(["two_rooms", "taxi"]), st.integers(0, 12), st.integers(0, 99))
def test_one_option_a_row_is_its_row_of_all(name: str, rows: int, seed: int) -> None:
    """Of actor, critic and terminations, for any number of rows, also none; gradients too."""
    options = compile_options(named(name))
    seen = torch.randn(rows, 7, generator=generator(seed), dtype=torch.float64)
    option = torch.randint(len(options), (rows,), generator=generator(seed, 1))
    for network in _networks(options):
        every, one = network(seen), network.one_option(seen, option)
        if every.dim() == 2:
            every = every[..., None]
        wanted = every[torch.arange(rows), option]
        assert one.shape == wanted.shape
        assert torch.allclose(one, wanted)
        weights = tuple(network.parameters())
        slopes = [torch.autograd.grad((found**2).sum(), weights) for found in (one, wanted)]
        for mine, theirs in zip(*slopes, strict=True):
            assert torch.allclose(mine, theirs)


def test_one_option_keeps_the_batch() -> None:
    """Rows may stand in any shape."""
    options = compile_options(named("taxi"))
    seen = torch.randn(2, 3, 7, generator=generator(0), dtype=torch.float64)
    option = torch.tensor([[0, 4, 9], [4, 4, 1]])
    for network, columns in zip(_networks(options), (6, 1, 2), strict=True):
        found = network.one_option(seen, option)
        assert found.shape == (2, 3, columns)
        assert torch.allclose(found.flatten(0, 1), network.one_option(seen.flatten(0, 1), option.flatten()))


def test_the_critic_sums_the_parts() -> None:
    """What an option is worth is what its parts say, times the scale."""
    options = compile_options(named("taxi"))
    _, critic, _ = _networks(options)
    assert isinstance(critic, Critic)
    seen = torch.randn(3, 7, generator=generator(0), dtype=torch.float64)
    parts, values = critic.networks(seen).squeeze(-1), critic(seen)
    for k in range(len(options)):
        own = [i for i in range(len(options.parts)) if options.made_of[k, i]]
        assert torch.allclose(values[:, k], 3.0 * parts[:, own].sum(1))


def test_tasks_on_several_stacks_have_one_policy() -> None:
    """Navigate(R) goes the same way for Get and for Put; Pickup and Putdown need no policy."""
    options = compile_options(named("taxi"))
    actor, _, _ = _networks(options)
    logits = actor(torch.randn(4, 7, generator=generator(0), dtype=torch.float64))
    by_name = {name: logits[:, k] for k, name in enumerate(options.names)}
    assert torch.equal(by_name["Get > Navigate(R)"], by_name["Put > Navigate(R)"])
    assert not torch.equal(by_name["Get > Navigate(R)"], by_name["Get > Navigate(G)"])
    assert (by_name["Get > Pickup"] == 0).all()


def test_what_is_no_task_ends_as_it_must() -> None:
    """A primitive action ends after its step; Get ends alike whatever it called."""
    options = compile_options(named("taxi"))
    _, _, ending = _networks(options)
    chances = ending(torch.randn(4, 7, generator=generator(0), dtype=torch.float64)).sigmoid()
    pickup, to_red, to_green = (
        options.names.index(n) for n in ("Get > Pickup", "Get > Navigate(R)", "Get > Navigate(G)")
    )
    assert (chances[:, pickup, 1] > 1 - 1e-12).all()
    assert torch.equal(chances[:, to_red, 0], chances[:, to_green, 0])
    assert not torch.equal(chances[:, to_red, 1], chances[:, to_green, 1])


@settings(max_examples=10, deadline=None)
@given(sound_graphs())
def test_a_level_that_an_option_lacks_never_ends(grounded: GroundGraph) -> None:
    """In graphs whose stacks differ in height; what is there may end."""
    options = compile_options(grounded)
    _, _, ending = _networks(options)
    chances = ending(torch.zeros(1, 7, dtype=torch.float64))[0].sigmoid()
    assert ((chances < 1e-12).numpy() == (options.nodes == NONE)).all()


@pytest.mark.parametrize("abstracted", [True, False])
def test_columns_are_those_that_a_part_uses(abstracted: bool) -> None:
    """Or all of them, where nothing is to be left out; a graph without parts has no rows."""
    encoding = Encoding(named("taxi").model.index)
    found = columns_of(encoding, [("taxi",), ("passenger", "destination")], abstracted=abstracted)
    for row, names in zip(found.tolist(), (("taxi",), ("passenger", "destination")), strict=True):
        assert row == [not abstracted or column in names for column in encoding.columns]
    assert columns_of(encoding, [], abstracted=abstracted).shape == (0, len(encoding.columns))

"""Settings of tabular learners: what they make of text, and what is refused."""

import re
from dataclasses import asdict, fields, replace
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from planners import Boltzmann, Exploration, HarmonicRate, LearningRate
from planners.config_text import parse_settings
from planners.tabular_config import TabularConfig, load_tabular_config
from worlds import UserError

PARTS = st.floats(1e-9, 1)
COUNTS = st.integers(1, 10**12)
CONFIGS = st.builds(
    TabularConfig,
    gamma=st.floats(0, 1),
    rate_falls=st.sampled_from(["fitting", "geometric", "harmonic"]),
    rate=PARTS,
    rate_decay=PARTS,
    rate_every=COUNTS,
    explores=st.sampled_from(["share", "boltzmann"]),
    heat=st.floats(1, 1e9),
    cooling=PARTS,
    cooling_of=st.sampled_from(["", "Root 0.5", "Root 1, GotoDoor(D1, D2) 0.25"]),
    all_states=st.booleans(),
    tie=st.floats(0, 1e9),
)


@given(config=CONFIGS)
def test_any_config_comes_back_from_its_text(config: TabularConfig) -> None:
    """Numbers keep every bit on their way through YAML."""
    assert parse_settings(TabularConfig(), yaml.safe_dump(asdict(config))) == config


def test_the_defaults_are_what_learners_always_had() -> None:
    """A rate of 1 where there is no chance, a harmonic one elsewhere; half the choices random after 300."""
    certain, chancy = (TabularConfig().settings(deterministic=sure) for sure in (True, False))
    assert (certain.rate, chancy.rate) == (LearningRate(1.0, 1.0, 1), HarmonicRate(1000))
    assert certain.exploration == chancy.exploration == Exploration(300)
    assert (certain.gamma, certain.tie, certain.max_steps, certain.all_states) == (1.0, 0.01, 100_000, False)


def test_boltzmann_cools_single_tasks_at_their_own_rate() -> None:
    """The heat is the same for all; without Boltzmann nothing is cooled."""
    given = {"explores": "boltzmann", "heat": "20", "cooling": "0.9", "cooling_of": "Root 0.5, A(b, c) 0.25"}
    settings = load_tabular_config(overrides=given).settings(deterministic=True)
    assert settings.exploration == Boltzmann(20.0, 0.9, 0.01)
    assert settings.explorations == {
        "Root": Boltzmann(20.0, 0.5, 0.01),
        "A(b, c)": Boltzmann(20.0, 0.25, 0.01),
    }
    assert not replace(TabularConfig(), cooling_of="Root 0.5").settings(deterministic=True).explorations


def test_single_values_count_more_than_a_file(tmp_path: Path) -> None:
    """What neither says keeps its default."""
    path = tmp_path / "mine.yaml"
    path.write_text("gamma: 0.9\ntie: 0.5\n")
    assert load_tabular_config(path, {"tie": "0.25"}) == TabularConfig(gamma=0.9, tie=0.25)


@pytest.mark.parametrize(
    "config", [TabularConfig(), TabularConfig(explores="boltzmann", rate_falls="harmonic")]
)
def test_all_settings_can_be_given_at_once(config: TabularConfig) -> None:
    """Those that are not read do no harm at their defaults."""
    assert (
        load_tabular_config(overrides={name: str(value) for name, value in asdict(config).items()}) == config
    )


@pytest.mark.parametrize(
    ("given", "problem"),
    [
        ({"rate": "0"}, "rate=0: 0 is not possible; give a number above 0, and at most 1"),
        ({"rate_decay": "1.5"}, "rate_decay=1.5: 1.5 is not possible; give a number above 0, and at most 1"),
        ({"rate_falls": "fast"}, "rate_falls=fast: fast is not possible; use one of fitting, "),
        ({"evaluate": "0"}, "evaluate=0: 0 is not possible; give a whole number from 1 to "),
        ({"heat": "1", "least_heat": "2"}, "least_heat: 2 is not possible; give at most the heat, 1"),
        ({"cooling_of": "Root"}, "cooling_of: 'Root' is not possible; give tasks with numbers"),
        ({"cooling_of": "Root 2"}, "cooling_of: 'Root 2' is not possible"),
        ({"cooling_of": "Root 0.5, Root 0.5"}, "cooling_of: Root is there twice; give it once"),
        ({"cooling": "0.5"}, "cooling: it is not read with explores=share; leave it out"),
        (
            {"explores": "boltzmann", "exploration_half": "3"},
            "exploration_half: it is not read with explores",
        ),
        (
            {"rate_falls": "geometric", "rate_half": "3"},
            "rate_half: it is not read with rate_falls=geometric",
        ),
        ({"max_step": "3"}, "max_step=3: there is no such setting; did you mean 'max_steps'?"),
    ],
)
def test_what_cannot_be_is_refused(given: dict[str, str], problem: str) -> None:
    """The message names the setting, what is wrong, and a mend."""
    with pytest.raises(UserError, match=re.escape(problem)):
        load_tabular_config(overrides=given)


@pytest.mark.parametrize(
    ("name", "value"), [("gamma", -0.1), ("total", 1.5), ("rate", "0.5"), ("cooling_of", 3)]
)
def test_the_dataclass_refuses_what_text_would(name: str, value: Any) -> None:
    """By keyword as well."""
    with pytest.raises(UserError, match=f"^{name}: {value!r} is not possible; give "):
        TabularConfig(**{name: value})


def test_no_setting_is_left_without_a_type_that_is_checked() -> None:
    """Every field refuses a value of another kind."""
    for field in fields(TabularConfig):
        with pytest.raises(UserError, match=f"^{field.name}: "):
            TabularConfig(**{field.name: [1]})


@given(config=CONFIGS, episodes=st.integers(0, 10**9))
def test_a_piece_is_never_empty(config: TabularConfig, episodes: int) -> None:
    """An evaluation comes nearer with every piece, and not before its share of the episodes."""
    piece = config.piece(episodes)
    assert piece >= config.evaluate
    assert piece >= int(config.spacing * episodes)

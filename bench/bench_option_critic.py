"""Option-critics beside flat learners on the paper's maze: one table, two figures, every goal by its figure.

Run with ``python bench/bench_option_critic.py FOLDER``; the tables are printed, and what was measured and the
figures are written into the folder. CPU time of one thread; it takes some twelve minutes of it. What the
folder holds already is not measured again.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import json
import statistics
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import torch
from one_env_option_critic import OneEnvOptionCritic
from option_critic_pictures import curves_figure, sweep_figure
from side_by_side import machine
from tabular_runs import TabularRun
from torchrl.collectors import Collector  # type: ignore[import-untyped]
from torchrl.envs import EnvBase  # type: ignore[import-untyped]

from comparisons.style import picture
from hierarchy import ground, two_rooms
from planners import flat_optimum
from planners.option_critic.config import OptionCriticConfig
from planners.option_critic.flat_baselines import FlatDQN, FlatPPO
from planners.option_critic.measures import Oracle, degeneracy
from planners.option_critic.options import compile_options
from planners.option_critic.training import OptionCritic
from worlds import load_layout, maze_model
from worlds.model_env import ModelTorchEnv
from worlds.torch_env import MazeTorchEnv

Learner = OptionCritic | FlatPPO | FlatDQN | TabularRun
Result = dict[str, Any]

MAZE = load_layout("two_rooms")
GROUNDED = ground(two_rooms(MAZE), maze_model(MAZE))
EVERY: Final = 2  # updates between two evaluations
TURNS: Final = 5
BATCHES: Final = 3  # of the Collector, in a turn
PUBLISHED: Final = 700
"""Steps a second of training of the quickest option-critic in PyTorch that is published."""
COSTS: Final = (0.0, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0)


class Cases(NamedTuple):
    """The 512 cases: states, the best return from each, and whether their pair was one of four."""

    states: np.ndarray[Any, np.dtype[np.int64]]
    best: np.ndarray[Any, np.dtype[np.float64]]
    four: np.ndarray[Any, np.dtype[np.bool_]]


def cases() -> Cases:
    """Return the model's 496 starts, and the 16 in which the robot is on the trigger and doors are open."""
    model, triggers, goals = GROUNDED.model, list(MAZE.triggers.values()), list(MAZE.goals.values())
    pressed = [model.index.number((t, t, g, "open")) for t in triggers for g in goals]
    states = np.concatenate([np.flatnonzero(model.starts), pressed])
    best = flat_optimum(model, GROUNDED.nodes[GROUNDED.root].terminal).value[states]
    return Cases(states, best, four_pairs()[states])


def four_pairs() -> np.ndarray[Any, np.dtype[np.bool_]]:
    """Return the states of the pairs T1G1, T2G2, T3G3 and T4G4, shape (states,)."""
    index = GROUNDED.model.index
    places = np.unravel_index(np.arange(index.size), index.shape)
    found: np.ndarray[Any, np.dtype[np.bool_]] = (
        places[index.names.index("trigger")] == places[index.names.index("goal")]
    )
    return found


@dataclass(frozen=True)
class Plan:
    """A learner of the table: what it is, how many seeds, and what is hoped for."""

    name: str
    kind: Callable[..., Learner]
    config: OptionCriticConfig
    seeds: int
    four: bool = False
    goal: str = ""
    group: str = field(default="table")


def plans() -> list[Plan]:
    """Return what is learnt, what matters most first."""
    given = OptionCriticConfig(total=200_000)
    prior = replace(given, terminations="prior", total=400_000)
    learnt = replace(given, terminations="learnt", total=200_000)
    few = replace(given, total=120_000)
    wide = replace(given, hidden=128, total=400_000)
    sweep = replace(given, terminations="learnt", abstracted=False, total=200_000)
    return [
        Plan("given", OptionCritic, given, 10, goal="512 of 512, 10 of 10 seeds; median <= 10 s, <= 150 k"),
        Plan("4 pairs, abstracted", OptionCritic, few, 5, four=True, goal="unseen >= 95 % in the median"),
        Plan("4 pairs, flat PPO", FlatPPO, replace(wide, total=few.total), 5, four=True, goal="beside it"),
        Plan("prior", OptionCritic, prior, 10, goal=">= 93 % in 20 s, every goal reached; stretch 10 of 10"),
        Plan("flat PPO", FlatPPO, wide, 5, goal="beside it"),
        *(
            Plan(f"cost {cost:g}", OptionCritic, replace(sweep, deliberation=cost), 3, group="sweep")
            for cost in COSTS
        ),
        Plan("4 pairs, full", OptionCritic, replace(few, abstracted=False), 5, four=True, goal="beside it"),
        Plan("learnt, no prior", OptionCritic, learnt, 5, goal="beside it"),
        Plan("flat DQN", FlatDQN, wide, 5, goal="beside it"),
        Plan("tabular option-critic (as published)", TabularRun, wide, 5, goal="beside it"),
    ]


def learn(plan: Plan, seed: int, asked: Cases, oracle: Oracle) -> Result:
    """Learn once, looking at the greedy policy every other update, and measure it at the end.

    Learning ends early once all cases are optimal; on four pairs, where this would look at the answer, never.
    """
    starts = GROUNDED.model.starts & four_pairs() if plan.four else None
    begin = time.process_time()
    learner = plan.kind(GROUNDED, seed, plan.config, starts=starts)
    spent, curve, optimal = time.process_time() - begin, [], np.zeros(len(asked.states), dtype=np.bool_)
    returns = np.full(len(asked.states), -np.inf)
    begin = time.process_time()
    for progress in learner.learn():
        if learner.updates % EVERY and progress.steps < plan.config.total:
            continue
        spent += time.process_time() - begin
        returns = learner.greedy().returns(asked.states)
        optimal = returns >= asked.best - 1e-6
        curve.append((progress.steps, spent, float(optimal.mean()), float(optimal[~asked.four].mean())))
        if optimal.all() and not plan.four and plan.group == "table":
            break
        begin = time.process_time()
    found: Result = {"name": plan.name, "group": plan.group, "seed": seed, "four": plan.four}
    found |= {"goal": plan.goal, "cost": plan.config.deliberation, "curve": curve, "cases": len(optimal)}
    found |= {"steps": learner.steps, "seconds": spent, "optimal": int(optimal.sum())}
    found |= {"unseen": float(optimal[~asked.four].mean()), "seen": float(optimal[asked.four].mean())}
    found["reached"] = int(np.isfinite(returns).sum())
    if isinstance(learner, OptionCritic):
        used = degeneracy(learner.greedy(), asked.states, beta=learner.terminations(), oracle=oracle)
        found |= {"options": asdict(used)}
    elif isinstance(learner, TabularRun):
        found |= {"options": asdict(learner.greedy().used(asked.states))}
    return found


def collecting(env: EnvBase, steps: int) -> float:
    """Return steps a second of CPU time of an environment in the Collector, by the random policy."""
    env.set_seed(0)
    frames = steps * int(env.batch_size.numel())
    collector = Collector(
        env,
        frames_per_batch=frames,
        total_frames=-1,
        no_cuda_sync=True,
        auto_register_policy_transforms=False,
    )
    batches = iter(collector)
    next(batches)
    begin = time.process_time()
    for _ in range(BATCHES):
        next(batches)
    spent = time.process_time() - begin
    collector.shutdown(close_env=False)
    return BATCHES * frames / spent


def throughput() -> Result:
    """Measure the environments in the Collector, and training beside the usual way, in turns."""
    found: dict[str, list[float]] = {"maze": [], "model": [], "ours": [], "usual": []}
    terminal = GROUNDED.nodes[GROUNDED.root].terminal
    ours = iter(OptionCritic(GROUNDED, 0).learn())
    usual = OneEnvOptionCritic(GROUNDED, 0)
    for turn in range(TURNS + 1):
        rates = {"maze": collecting(MazeTorchEnv(1024), 64)}
        rates["model"] = collecting(ModelTorchEnv(GROUNDED.model, terminal, 1024), 64)
        begin = time.process_time()
        for _ in range(4):
            next(ours)
        rates["ours"] = 4 * OptionCriticConfig().per_update / (time.process_time() - begin)
        begin = time.process_time()
        usual.learn(1500)
        rates["usual"] = 1500 / (time.process_time() - begin)
        for name, rate in rates.items():
            found[name] += [rate] if turn else []  # the first warms up
    return {"group": "rates", "name": "rates", **{name: statistics.median(of) for name, of in found.items()}}


def of_name(results: list[Result], group: str) -> Iterator[tuple[str, list[Result]]]:
    """Yield each learner's results, in order."""
    chosen = [one for one in results if one["group"] == group]
    chosen.sort(key=lambda one: float(one["cost"]))
    for name in dict.fromkeys(one["name"] for one in chosen):
        yield name, [one for one in chosen if one["name"] == name]


def _median(rows: list[Result], name: str) -> float:
    return float(statistics.median(row[name] for row in rows))


def table(results: list[Result]) -> str:
    """Return the learners by seeds, as Markdown."""
    lines = [
        "| learner | seeds | all 512 optimal | optimal, median (least) | unseen pairs optimal, median (least)"
        " | goal reached | steps | CPU seconds | steps a second | goal |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for name, rows in of_name(results, "table"):
        share = [row["optimal"] / row["cases"] for row in rows]
        unseen = [row["unseen"] for row in rows]
        told = (
            name,
            len(rows),
            f"{sum(one == 1 for one in share)} of {len(rows)}",
            f"{statistics.median(share):.1%} ({min(share):.1%})",
            f"{statistics.median(unseen):.1%} ({min(unseen):.1%})" if rows[0]["four"] else "",
            f"{min(row['reached'] for row in rows)} of {rows[0]['cases']}",
            f"{_median(rows, 'steps') / 1000:.0f} k",
            f"{_median(rows, 'seconds'):.1f}",
            f"{statistics.median(row['steps'] / row['seconds'] for row in rows):,.0f}",
            rows[0]["goal"],
        )
        lines.append("| " + " | ".join(str(cell) for cell in told) + " |")
    return "\n".join(lines)


def use_table(results: list[Result]) -> str:
    """Return how the options are used, medians over seeds, as Markdown."""
    lines = [
        "| learner | steps an option | changes | usage entropy | beta at subgoals | beta elsewhere |"
        " oracle's subtasks | optimal actions | cases optimal |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for group in ("table", "sweep"):
        for name, rows in of_name(results, group):
            if "options" in rows[0]:
                used = [key for key in rows[0]["options"] if key != "steps"]
                medians = [statistics.median(row["options"][key] for row in rows) for key in used]
                cells = ["" if np.isnan(median) else f"{median:.2f}" for median in medians]
                share = statistics.median(row["optimal"] / row["cases"] for row in rows)
                lines.append(f"| {name} | " + " | ".join(cells) + f" | {share:.1%} |")
    return "\n".join(lines)


def rates_table(rates: Result) -> str:
    """Return the throughputs, each beside its goal, as Markdown."""
    ratio = rates["ours"] / rates["usual"]
    return "\n".join(
        [
            "| what | steps a second | goal |",
            "|---|---|---|",
            f"| Collector, N = 1024, MazeTorchEnv | {rates['maze'] / 1e6:.2f} M | >= 1 M |",
            f"| Collector, N = 1024, ModelTorchEnv | {rates['model'] / 1e6:.2f} M | >= 1 M |",
            f"| training, ours | {rates['ours']:,.0f} | |",
            f"| training, one environment, an update a step | {rates['usual']:,.0f} | |",
            f"| ours to the quickest published, {PUBLISHED} | {rates['ours'] / PUBLISHED:.0f} x | >= 20 x |",
            f"| ours to the one above | {ratio:.0f} x | beside it |",
        ]
    )


def main(folder: Path) -> None:
    """Measure, print the tables and draw the figures."""
    torch.set_num_threads(1)
    folder.mkdir(parents=True, exist_ok=True)
    asked, oracle = cases(), Oracle(compile_options(GROUNDED))
    kept = folder / "option_critic.jsonl"
    results: list[Result] = []
    if kept.exists():
        results = [json.loads(line) for line in kept.read_text(encoding="utf-8").splitlines()]
    there = {(one["name"], one.get("seed")) for one in results}
    jobs: dict[tuple[str, int | None], Callable[[], Result]] = {("rates", None): throughput}
    for plan in plans():
        for seed in range(plan.seeds):
            jobs[plan.name, seed] = partial(learn, plan, seed, asked, oracle)
    with kept.open("a", encoding="utf-8") as lines:
        for name, job in jobs.items():
            if name not in there:
                results.append(job())
                print(json.dumps(results[-1]), file=lines, flush=True)
    report(results, folder)


def report(results: list[Result], folder: Path) -> None:
    """Print the tables and draw the figures of what was measured."""
    print(f"{machine()}, one thread, CPU time; medians over seeds\n")
    (rates,) = (one for one in results if one["group"] == "rates")
    print(f"{table(results)}\n\n{use_table(results)}\n\n{rates_table(rates)}")
    drawn = {
        "option_critic_curves": curves_figure(dict(of_name(results, "table"))),
        "option_critic_deliberation": sweep_figure(dict(of_name(results, "sweep"))),
    }
    for name, figure in drawn.items():
        (folder / f"{name}.png").write_bytes(picture(figure).png)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "bench-option-critic"))

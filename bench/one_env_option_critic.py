"""An option-critic in PyTorch as it is usually published: one environment, one update a step, eager code.

Bacon, Harb and Precup, "The option-critic architecture" (AAAI 2017), algorithm 1 with a network, a replay
buffer for the critic and a slow copy of it. It is here to be timed beside ours, in the same run.
"""

from __future__ import annotations

from collections import deque
from random import Random
from typing import Final

import numpy as np
import torch
from torch import Tensor, nn

from hierarchy import GroundGraph
from worlds.encoding import Encoding

_OPTIONS, _HIDDEN, _BATCH, _EVERY, _COPY = 4, 128, 32, 4, 200
_GAMMA, _EPSILON, _ENTROPY, _REGULARISER = 0.98, 0.1, 0.01, 0.01
_LONGEST: Final = 200


class Network(nn.Module):
    """Shared features, and on them the options' values, terminations and policies."""

    def __init__(self, columns: int, actions: int) -> None:
        super().__init__()
        self.features = nn.Sequential(
            nn.Linear(columns, _HIDDEN), nn.ReLU(), nn.Linear(_HIDDEN, _HIDDEN), nn.ReLU()
        )
        self.values, self.ends = nn.Linear(_HIDDEN, _OPTIONS), nn.Linear(_HIDDEN, _OPTIONS)
        self.logits = nn.Linear(_HIDDEN, _OPTIONS * actions)

    def policy(self, features: Tensor, option: int) -> torch.distributions.Categorical:
        """Return an option's policy in one state."""
        return torch.distributions.Categorical(logits=self.logits(features).view(_OPTIONS, -1)[option])


class OneEnvOptionCritic:
    """Learns a step at a time, on the CPU."""

    def __init__(self, grounded: GroundGraph, seed: int) -> None:
        torch.manual_seed(seed)
        self.random = Random(seed)  # noqa: S311 - not for secrets
        model = grounded.model
        self.after, self.rewards = model.successors.tolist(), model.rewards.tolist()
        self.over = grounded.nodes[grounded.root].terminal.tolist()
        self.starts = np.flatnonzero(model.starts).tolist()
        encoding = Encoding(model.index)
        self.seen = encoding(torch.arange(model.index.size))
        self.network = Network(len(encoding.columns), len(model.actions))
        self.slow = Network(len(encoding.columns), len(model.actions))
        self.slow.load_state_dict(self.network.state_dict())
        self.optimiser = torch.optim.RMSprop(self.network.parameters(), lr=5e-4)
        self.memory: deque[tuple[int, int, float, int, bool]] = deque(maxlen=10_000)
        self.steps, self.length, self.option, self.fresh = 0, 0, 0, True
        self.state = self.random.choice(self.starts)

    def learn(self, steps: int) -> None:
        """Take so many steps, with an update after each."""
        for _ in range(steps):
            self._step()

    def _step(self) -> None:
        features = self.network.features(self.seen[self.state])
        if self.fresh:
            best = int(self.network.values(features).argmax())
            self.option = self.random.randrange(_OPTIONS) if self.random.random() < _EPSILON else best
        policy = self.network.policy(features, self.option)
        action = policy.sample()
        after = self.after[self.state][int(action)]
        reward, over = self.rewards[self.state][int(action)], self.over[after]
        self.memory.append((self.state, self.option, reward, after, over))
        self.steps, self.length = self.steps + 1, self.length + 1
        loss = self._actor_loss(features, policy, action, (reward, after, over))
        if len(self.memory) >= _BATCH and self.steps % _EVERY == 0:
            loss = loss + self._critic_loss()
        self.optimiser.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        self.optimiser.step()
        if self.steps % _COPY == 0:
            self.slow.load_state_dict(self.network.state_dict())
        self.state, self.fresh = after, over or self.random.random() < self.ending
        if over or self.length == _LONGEST:
            self.state, self.length, self.fresh = self.random.choice(self.starts), 0, True

    def _actor_loss(
        self,
        features: Tensor,
        policy: torch.distributions.Categorical,
        action: Tensor,
        came: tuple[float, int, bool],
    ) -> Tensor:
        option, (reward, after, over) = self.option, came
        there = self.network.features(self.seen[after])
        ends = self.network.ends(there).sigmoid()[option]
        self.ending = float(ends.detach())
        with torch.no_grad():
            slow = self.slow.values(self.slow.features(self.seen[after]))
            worth = (1 - ends) * slow[option] + ends * slow.max()
            target = reward + (not over) * _GAMMA * worth
            here, ahead = self.network.values(features)[option], self.network.values(there)
            ahead = ahead[option] - ahead.max() + _REGULARISER
        actor = -policy.log_prob(action) * (target - here) - _ENTROPY * policy.entropy()
        return actor + (not over) * ends * ahead

    def _critic_loss(self) -> Tensor:
        rows = self.random.sample(self.memory, _BATCH)
        state, option, reward, after, over = (torch.tensor(part) for part in zip(*rows, strict=True))
        with torch.no_grad():
            features = self.slow.features(self.seen[after])
            slow, ends = self.slow.values(features), self.slow.ends(features).sigmoid()
            going, ends = slow.gather(1, option[:, None])[:, 0], ends.gather(1, option[:, None])[:, 0]
            worth = (1 - ends) * going + ends * slow.amax(1)
            target = reward + (~over).float() * _GAMMA * worth
        values = self.network.values(self.network.features(self.seen[state]))
        return nn.functional.mse_loss(values.gather(1, option[:, None])[:, 0], target)

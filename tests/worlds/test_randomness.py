from collections import Counter

import pytest
from hypothesis import given
from hypothesis import strategies as st

from worlds import Stream
from worlds.randomness import mix

GOLDEN = 0x9E37_79B9_7F4A_7C15
keys = st.lists(st.integers(-(2**70), 2**70), max_size=4)


def test_mix_gives_the_published_outputs() -> None:
    """SplitMix64 with seed 0 begins with these numbers, in its authors' code."""
    published = [0xE220A8397B1DCDAF, 0x6E789E6AA1B965F4, 0x06C45D188009454F]
    assert [mix(k * GOLDEN) for k in (1, 2, 3)] == published


def test_a_stream_without_a_key_is_splitmix64_with_seed_0() -> None:
    """The draws of a stream are the generator's outputs, in order and none left out."""
    stream = Stream()
    assert [stream.bits() for _ in range(2)] == [0xE220A8397B1DCDAF, 0x6E789E6AA1B965F4]


@given(st.sets(st.integers(0, 2**64 - 1), max_size=50))
def test_mix_is_one_to_one(numbers: set[int]) -> None:
    """No two inputs share an output."""
    assert len({mix(number) for number in numbers}) == len(numbers)


@given(keys)
def test_same_key_same_numbers(key: list[int]) -> None:
    """A stream is decided by its key."""
    a, b = Stream(*key), Stream(*key)
    assert [a.bits() for _ in range(5)] == [b.bits() for _ in range(5)]


@given(st.integers(0, 2**32), st.integers(0, 100), st.integers(0, 100))
def test_every_part_of_the_key_counts(seed: int, a: int, b: int) -> None:
    """Streams of one seed differ by their other parts, and the order of the parts counts."""
    draws = {key: Stream(*key).bits() for key in [(seed,), (seed, a), (seed, b), (seed, a, b), (seed, b, a)]}
    assert len(set(draws.values())) == len(draws)


@given(keys, st.integers(1, 2**40))
def test_draws_are_in_range(key: list[int], n: int) -> None:
    """A uniform draw is in [0, 1), a whole one in range(n)."""
    stream = Stream(*key)
    for _ in range(10):
        assert 0.0 <= stream.uniform() < 1.0
        assert 0 <= stream.below(n) < n


def test_uniform_draws_are_uniform() -> None:
    """10,000 draws in ten bins stay within 5 standard deviations (150) of 1,000 a bin."""
    stream = Stream(3)
    bins = Counter(int(stream.uniform() * 10) for _ in range(10_000))
    assert all(abs(bins[i] - 1000) < 150 for i in range(10))


def test_whole_draws_are_uniform_and_streams_unlike() -> None:
    """The first draws of 7,000 neighbouring streams fall evenly on 0 to 6."""
    bins = Counter(Stream(1, episode).below(7) for episode in range(7000))
    assert all(abs(bins[i] - 1000) < 150 for i in range(7))


def test_between_scales_a_uniform_draw() -> None:
    """Its ends are those given."""
    draws = [Stream(5, i).between(-2.0, 6.0) for i in range(500)]
    assert draws == [-2.0 + 8.0 * Stream(5, i).uniform() for i in range(500)]


@given(keys, st.lists(st.integers(), max_size=20))
def test_shuffled_keeps_the_items(key: list[int], items: list[int]) -> None:
    """Shuffling loses nothing, adds nothing, and leaves its argument alone."""
    before = list(items)
    assert Counter(Stream(*key).shuffled(items)) == Counter(before)
    assert items == before


def test_shuffled_gives_every_order_alike() -> None:
    """The six orders of three items come about equally often in 6,000 shuffles."""
    orders = Counter(tuple(Stream(9, i).shuffled("abc")) for i in range(6000))
    assert len(orders) == 6
    assert all(abs(count - 1000) < 150 for count in orders.values())


def test_choosing_from_nothing_fails() -> None:
    """There is no item to return."""
    with pytest.raises(IndexError):
        Stream(1).choose([])

"""Cards of files of arrays."""

from dataclasses import dataclass

import pytest
from pydantic import TypeAdapter

from worlds import UserError
from worlds.tensor_file import Cards


@dataclass(frozen=True)
class _Card:
    name: str
    format: int = 2


_CARDS = Cards(TypeAdapter(_Card), 2, 40, missing="this is no letter; name one", mend="write it anew")


def test_a_card_is_read() -> None:
    """Up to as many characters as it may have."""
    assert _CARDS.read('{"name": "a", "format": 2}'.ljust(40), "a.safetensors") == _Card("a")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (None, "a.safetensors: this is no letter; name one"),
        (" " * 41, "a.safetensors: the card has more than 40 characters; write it anew"),
        ('{"name": 1}', "a.safetensors: the card is wrong at name: Input should be a valid string"),
        ("[]", "a.safetensors: the card is wrong at the whole: .*; write it anew"),
        ("{", "a.safetensors: the card is wrong at the whole: Invalid JSON.*; write it anew"),
        ('{"name": "a", "format": 3}', "the card is of format 3; this affordant reads 2: update it"),
    ],
)
def test_a_wrong_card_is_refused(text: str | None, message: str) -> None:
    """The message names the file, the field and the mend."""
    with pytest.raises(UserError, match=message):
        _CARDS.read(text, "a.safetensors")

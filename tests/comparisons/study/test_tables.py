"""Tables of text, and the two that a study's report shows."""

import re
from dataclasses import replace
from html.parser import HTMLParser

import pytest
from hypothesis import given
from hypothesis import strategies as st
from study_rows import COST, OPTIMAL, STEPS, Asked, rows

from comparisons.study.kinds import Measure, Result
from comparisons.study.results.answers import answers
from comparisons.study.results.summaries import comparisons_table, study_table
from comparisons.study.results.tables import Table
from comparisons.study.results.wording import decimals_of, number, plain, spread

HOSTILE = 'a|b `c` *d* _e_ [f](g) <script>&amp;$h$\\ "i" ~j~\nk'
DASH = "\N{EN DASH}"
awkward = st.text(max_size=12) | st.text("|\\`*_[]<>&$~#%{}^-\n\r\t '\"", max_size=12)


class Reader(HTMLParser):
    """Collects the text of each cell."""

    def __init__(self) -> None:
        super().__init__(convert_charrefs=True)
        self.cells: list[str] = []
        self.tags: set[str] = set()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Begin a cell."""
        assert {name for name, _ in attrs} <= {"class", "scope"}
        self.tags.add(tag)
        if tag in ("td", "th"):
            self.cells.append("")

    def handle_data(self, data: str) -> None:
        """Go on with a cell."""
        if self.cells:
            self.cells[-1] += data


@given(awkward, awkward)
def test_html_shows_any_text_as_it_is(first: str, second: str) -> None:
    """Whatever the cells hold is text of the cells, and makes no tag."""
    reader = Reader()
    reader.feed(str(Table((first, "n"), ((second, "1"),), "A table").html()))
    reader.close()
    newlines = [re.sub(r"\r\n?", "\n", text) for text in (first, second)]
    shown = [re.sub(r"\r\n?", "\n", cell) for cell in reader.cells]
    assert shown == [newlines[0], "n", newlines[1], "1"]
    assert reader.tags == {"table", "caption", "thead", "tbody", "tr", "th", "td"}


@given(awkward, awkward)
def test_markdown_rows_keep_their_cells(first: str, second: str) -> None:
    """Each row stays one line with its number of cells, whatever they hold."""
    text = Table((first, "n"), ((second, "1"), ("x", "2")), "A table").markdown()
    lines = text.split("\n")[2:]
    assert len(lines) == 5
    for line in (*lines[:1], *lines[2:4]):
        assert len(re.findall(r"(?<!\\)(?:\\\\)*\|", line)) == 3


@given(awkward, awkward)
def test_latex_rows_keep_their_cells(first: str, second: str) -> None:
    """Each row is one line with one separator, and no sign of LaTeX's own is left as it was."""
    lines = Table((first, "n"), ((second, "1"),), "A table").latex().split("\n")
    assert len(lines) == 12
    for line in (lines[5], lines[7]):
        cell, _, rest = line[4:].partition(" & ")
        assert rest in ("n \\\\", "1 \\\\")
        bare = re.sub(r"\\text[a-z]+\{\}|\\[{}$&#%_]|\{[\[\]*]\}|\{\}", "", cell)
        assert not set(bare) & set('\\{}$&#%_^~<>|[]*"')
        assert "--" not in cell
        assert "``" not in cell


def test_hostile_cells_are_escaped() -> None:
    """Signs that mean something to Markdown and LaTeX are written as themselves."""
    table = Table(("name",), ((HOSTILE,),), "50 % & more")
    assert (
        r"| a\|b \`c\` \*d\* \_e\_ \[f\](g) \<script\>\&amp;\$h\$\\ " + '"i" ' + r"\~j\~ k |"
    ) in table.markdown()
    latex = table.latex("tab:a b")
    assert r"\caption{50 \% \& more}" in latex
    assert r"\label{tab:a-b}" in latex
    assert r"a\textbar{}b `c` {*}d{*} \_e\_ {[}f{]}(g) \textless{}script\textgreater{}\&amp;\$h\$" in latex
    assert "maxq{}" not in Table(("maxq-0",), (), "x").latex()
    assert "a-{}-b" in Table(("a--b",), (), "x").latex()


def test_a_row_of_another_length_is_a_bug() -> None:
    """Rows have as many cells as there are columns."""
    with pytest.raises(ValueError, match="a row has 1 cells, and there are 2 columns"):
        Table(("a", "b"), (("1",),), "A table")


def test_the_main_table() -> None:
    """Each combination has its estimates, its seeds, and how many runs failed."""
    many = rows(STEPS, {"1": [1000.0 + seed for seed in range(10)], "0.9": [None] * 3 + [2000.0] * 7})
    few, absent = rows(STEPS, {"0.5": [3000.0] * 3}), rows(STEPS, {"0.5": [0.0] * 5, "0": [0.0] * 2})[3:]
    table = study_table([*many, *few], [STEPS, OPTIMAL], missing=absent, failed=absent[:1], caption="All")
    assert table.columns == ("gamma", "steps to optimal", "optimal", "seeds", "failed")
    assert table.rows == (
        ("1", "1,004 (1,002 to 1,007)", DASH, "10", "0"),
        ("0.9", "never (2,000 to never), 7 of 10 got there", DASH, "10", "0"),
        ("0.5", "3,000 (3,000 to 3,000)*", DASH, "3 of 5", "1"),
        ("0", DASH, DASH, "0 of 2", "0"),
    )
    assert table.note == (
        "Each is the interquartile mean over seeds with its 95 % interval. steps to optimal: environment "
        "steps until every start is optimal (steps); optimal: affordances that are proved optimal first "
        "actions. * fewer than 5 seeds: not to be ranked."
    )
    assert study_table([], [STEPS]).rows == ()


def test_shares_and_what_tells_nothing_in_the_main_table() -> None:
    """Shares stand in per cent, and runs that had nothing to tell are counted."""
    table = study_table(
        rows(OPTIMAL, {"1": [0.9, 0.92, 0.94, 0.92, 0.9, None]}), [OPTIMAL], statistic="median"
    )
    assert table.rows == (("1", "92.0 % (90.0 to 94.0 %), 1 without", "6", "0"),)
    assert table.note.endswith("Without: runs in which there was nothing of it to measure.")


def test_a_measure_that_runs_have_not_got_is_not_said_to_be_missed() -> None:
    """None is never; a measure that is left out is nothing."""
    episodes = Measure("episodes", "episodes until every start is optimal", "episodes", "less")
    kept = [replace(row, result=Result({"episodes": None})) for row in rows(STEPS, {"tables": [1.0] * 5})]
    table = study_table([*kept, *rows(STEPS, {"networks": [1.0] * 5})], [episodes])
    assert [row[1] for row in table.rows] == ["never, 0 of 5 got there", DASH]


def test_the_comparisons_table() -> None:
    """Each comparison has its ratio, its difference, the chance to be better and both p values."""
    by_level = {"1": [10.0 + seed for seed in range(8)], "2": [20.0 + 2 * seed for seed in range(8)]}
    by_level["3"], by_level["4"] = [None] * 8, [1.0] * 3
    table = comparisons_table(answers(Asked(), STEPS, rows(STEPS, by_level)).told, STEPS)
    assert table.columns[:3] == ("gamma", "against", "ratio")
    assert table.rows[0][:3] == ("2", "1", "2.00 (2.00 to 2.00)")
    assert table.rows[0][5:] == ("8", "0.0078", "0.016")
    assert table.rows[1][2:4] == ("infinite", "infinite")
    assert table.rows[1][4] == "0.0 % (0.0 to 32.4 %)"
    assert table.rows[2][4:] == (DASH, "3", DASH, DASH)
    assert "Holm's correction for 2 comparisons" in table.note
    assert comparisons_table([], STEPS).rows == ()


def test_comparisons_of_shares_and_of_nothing() -> None:
    """Differences of shares are points; what has no better has no chance; no pair leaves dashes."""
    shares = answers(Asked(OPTIMAL.name), OPTIMAL, rows(OPTIMAL, {"1": [0.5] * 6, "2": [0.25] * 6})).told
    assert comparisons_table(shares, OPTIMAL).rows[0][2:4] == (DASH, "-25.0 (-25.0 to -25.0) points")
    costs = answers(Asked(COST.name), COST, rows(COST, {"1": [2.0] * 6, "2": [3.0] * 6})).told
    assert comparisons_table(costs, COST).rows[0][4] == DASH
    there = rows(STEPS, {"1": [2.0] * 6})
    nothing = answers(Asked(), STEPS, there, rows(STEPS, {"2": [0.0] * 6})).told
    assert comparisons_table(nothing, STEPS).rows[0][2:] == (DASH, DASH, DASH, "0", DASH, DASH)


@given(st.floats(-1e9, 1e9))
def test_numbers_keep_three_digits(value: float) -> None:
    """A number's text is within half a per cent of it, and no zero has a sign."""
    text = plain(value)
    assert float(text.replace(",", "")) == pytest.approx(value, rel=0.0051, abs=1e-12)
    assert not text.startswith("-0") or float(text)


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (1.0, "100.0 %"),
        (0.99996, "99.996 %"),
        (0.0002, "0.02 %"),
        (0.0, "0.0 %"),
        (1e-12, "0.0 %"),
        (-0.0004, "-0.04 %"),
        (1 / 3, "33.3 %"),
    ],
)
def test_shares_are_in_per_cent(value: float, words: str) -> None:
    """A share has one decimal of a per cent, or more where it would look like all or nothing."""
    assert number(value, OPTIMAL) == words


def test_bounds_share_their_decimals() -> None:
    """A number and its bounds have as many decimals as its size or the interval's width asks for."""
    assert decimals_of(0.0) == 0
    assert decimals_of(99.97) == 0
    assert spread(0.5, 0.25, 30.0, STEPS) == "0.5 (0.2 to 30.0)"
    assert spread(0.0, 0.0, 0.0, STEPS, unit=True) == "0 steps (0 to 0)"
    assert spread(5.0, float("-inf"), float("inf"), STEPS) == "5.00 (no interval)"
    assert spread(float("inf"), float("inf"), float("inf"), STEPS, unit=True) == "never"

import base64
import json
import re

import cv2
import numpy as np
import pytest
from html_reader import Reader
from matplotlib.figure import Figure

from comparisons.figures import value_counts_figure
from comparisons.report import Replay, ReplayFrame, Report, Section, Table, Verdict, render
from comparisons.style import Picture, picture

EVIL = '<script>alert("&")</script>'


def frame(value: int) -> np.ndarray:
    """Return a small image, red at its left and of one grey elsewhere."""
    image = np.full((8, 8, 3), value, dtype=np.uint8)
    image[:, 0] = (255, 0, 0)
    return image


def drawings() -> dict[str, Picture]:
    """Return two figures that are shorter as SVG, and one that is shorter as PNG."""
    dense = Figure((2, 2))
    dense.add_subplot().plot(np.arange(20_000) % 97, np.arange(20_000) % 89)
    figures = {
        "values": value_counts_figure([("flat Q", 4096), ("leaves", 4)]),
        "steps": value_counts_figure([(EVIL, 3), ("leaves", 4)]),
        "dense": dense,
    }
    return {name: picture(figure) for name, figure in figures.items()}


def report() -> Report:
    """Return a report that holds every kind of content."""
    table = Table(
        "The pairs.",
        ("pair", "steps", "share", "verdict", "mixed"),
        (("T1, G1", 7, "99.5 %", Verdict(True, "optimal"), 1), ("T1, G2", 12.5, None, False, "none")),
    )
    frames = (
        ReplayFrame(frame(10), frame(20), ("Step 0", "</script>" + EVIL)),
        ReplayFrame(frame(10), None, ("Step 1",)),
    )
    return Report(
        "A report & more",
        (("pairs", Verdict(True, "16 of 16"), "from every start"), ("accuracy", 0.98765, EVIL)),
        (
            Section("Learning", ("First.", EVIL), (("values", "Values."), ("dense", "Dense."))),
            Section("Learning", (), (("steps", EVIL),), (table,)),
        ),
        Replay(frames, "Replay of the run"),
        "Seed 0.",
    )


@pytest.fixture(scope="module")
def page() -> str:
    """Return the report's page."""
    return render(report(), drawings())


@pytest.fixture(scope="module")
def read(page: str) -> Reader:
    """Return the page as it is read."""
    return Reader(page)


def test_the_page_needs_nothing_but_itself(page: str, read: Reader) -> None:
    """No address leads out of the page: only names of XML spaces look like one."""
    outward = re.sub(r' xmlns(:\w+)?="http://www\.w3\.org/[^"]*"', "", page)
    assert not re.search(r"https?://|@import|//[a-z]+\.", outward)
    assert all(link.startswith(("#", "data:")) for link in read.links)
    assert {link[1:] for link in read.links if link.startswith("#")} <= set(read.ids)


def test_the_page_is_well_formed(read: Reader) -> None:
    """Every element is closed in its turn, and no id stands twice, also not in two figures."""
    assert read.open == []
    assert len(set(read.ids)) == len(read.ids)


def test_every_section_is_shown_and_listed(page: str, read: Reader) -> None:
    """Title, lead, summary, sections, captions and tables all stand in the page; contents link to each."""
    expected = {"A report & more", "Seed 0.", "pairs", "16 of 16", "from every start", "0.9877", "First."}
    expected |= {"Figure 1.", "Figure 2.", "Figure 3.", "Table 1.", "The pairs.", "T1, G1", "12.5"}
    assert expected <= set(read.texts)
    contents = page[page.index("<nav") : page.index("</nav>")]
    assert re.findall(r'href="#([^"]+)"', contents) == ["summary", "replay", "1-learning", "2-learning"]


def test_markup_in_texts_is_shown_and_not_followed(page: str, read: Reader) -> None:
    """A script in a paragraph, note, caption, figure or replay stays text."""
    assert EVIL not in page
    assert page.count("<script") == read.tags.count("script") == 3
    assert read.texts.count(EVIL) == 3


def test_the_same_report_gives_the_same_page(page: str) -> None:
    """Two renderings of freshly drawn figures are equal byte by byte."""
    assert render(report(), drawings()) == page


def test_each_figure_takes_its_shorter_form(page: str) -> None:
    """Sparse drawings are inline SVG and dense ones PNG."""
    found = re.findall(r"<figure>\s*<(svg|img)", page[page.index('<section id="1-') :])
    assert found == ["svg", "img", "svg"]


def test_numbers_are_on_the_right_and_verdicts_say_so_in_words(page: str) -> None:
    """A column of numbers (or dashes) is right-aligned, one of words is not; verdicts carry both signs."""
    head = page[page.index("<thead>") : page.index("</thead>")]
    assert re.findall(r'<th scope="col"( class="n")?>(\w+)', head) == [
        ("", "pair"),
        (' class="n"', "steps"),
        (' class="n"', "share"),
        ("", "verdict"),
        ("", "mixed"),
    ]
    verdicts = re.findall(r'<span class="verdict (\w+)"><span aria-hidden="true">(.)</span> ([^<]+)', page)
    assert verdicts == [("yes", "✓", "16 of 16"), ("yes", "✓", "optimal"), ("no", "✗", "no")]


def test_the_replay_holds_its_frames_without_loss(page: str) -> None:
    """The player's pictures decode to the frames given, RGB in order; one that comes twice is kept once."""
    found = re.search(r'id="replay-data">(.*?)</script>', page, re.DOTALL)
    assert found is not None
    data = json.loads(found[1])
    assert len(data["images"]) == 2
    assert [(step["overview"], step["view"]) for step in data["steps"]] == [(0, 1), (0, None)]
    assert data["steps"][0]["caption"] == ["Step 0", "</script>" + EVIL]
    for url, value in zip(data["images"], (10, 20), strict=True):
        png = np.frombuffer(base64.b64decode(url.removeprefix("data:image/png;base64,")), dtype=np.uint8)
        image = cv2.imdecode(png, cv2.IMREAD_COLOR_RGB)
        assert (image == frame(value)).all()


def test_a_report_without_replay_has_no_player() -> None:
    """Without a replay the page holds no player and no link to one."""
    page = render(Report("Small"), {})
    assert "replay" not in page
    assert Reader(page).open == []


def test_a_missing_figure_is_named() -> None:
    """A section that names a figure which is not given is refused by name, with those there are."""
    wrong = Report("x", sections=(Section("Learning", figures=(("curve", ""),)),))
    with pytest.raises(ValueError, match=r"'Learning' names the figure 'curve'.*\(none\)"):
        render(wrong, {})


def test_a_ragged_table_is_refused() -> None:
    """A row that is not as long as the header is refused with its number."""
    with pytest.raises(ValueError, match="row 1 has 1 cells, the header 2"):
        Table("t", ("a", "b"), ((1, 2), (3,)))


def test_a_frame_of_another_kind_is_refused() -> None:
    """A replay takes uint8 RGB images only."""
    wrong = Replay((ReplayFrame(np.zeros((4, 4), dtype=np.uint8)),))
    with pytest.raises(ValueError, match="uint8 images of shape"):
        render(Report("x", replay=wrong), {})

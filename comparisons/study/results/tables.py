"""Tables of text, written as Markdown, as LaTeX for a paper, and as HTML."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Final

from markupsafe import Markup, escape

_CONTROL: Final = re.compile(r"[\x00-\x20\x7f-\x9f\u2028\u2029]+")
_MARKDOWN: Final = re.compile(r"([\\`*_\[\]<>|&$~])")
_LATEX: Final = {
    "\\": r"\textbackslash{}",
    "^": r"\textasciicircum{}",
    "~": r"\textasciitilde{}",
    "<": r"\textless{}",
    ">": r"\textgreater{}",
    "|": r"\textbar{}",
    '"': "''",
    **{sign: f"\\{sign}" for sign in "{}$&#%_"},
    # After the end of a row these would be read as its options.
    **{sign: f"{{{sign}}}" for sign in "[]*"},
}


@dataclass(frozen=True)
class Table:
    """A table whose cells are text.

    Parameters
    ----------
    columns
        Heads.
    rows
        Cells, as many in each row as there are columns.
    caption
        What it shows.
    note
        What a reader has to know besides; "" for nothing.
    labels
        How many columns, from the left, name the row; the others are numbers, and stand to the right.

    Raises
    ------
    ValueError
        If a row has more or fewer cells than there are columns.

    Examples
    --------
    >>> table = Table(("gamma", "steps"), (("1", "5,400"), ("0.9", "7,700")), "Steps by gamma")
    >>> print(table.markdown())
    **Steps by gamma**
    <BLANKLINE>
    | gamma | steps |
    | :--- | ---: |
    | 1 | 5,400 |
    | 0.9 | 7,700 |
    <BLANKLINE>
    """

    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    caption: str
    note: str = ""
    labels: int = 1

    def __post_init__(self) -> None:
        for row in self.rows:
            if len(row) != len(self.columns):
                raise ValueError(f"a row has {len(row)} cells, and there are {len(self.columns)} columns")

    def markdown(self) -> str:
        """Return it as Markdown: the table is GitHub's kind."""
        rule = [":---" if i < self.labels else "---:" for i in range(len(self.columns))]
        lines = [_markdown_row(self.columns), f"| {' | '.join(rule)} |", *map(_markdown_row, self.rows)]
        note = f"\nNote: {_in_markdown(self.note)}\n" if self.note else ""
        return f"**{_in_markdown(self.caption)}**\n\n" + "\n".join(lines) + f"\n{note}"

    def latex(self, label: str = "") -> str:
        r"""Return it as LaTeX, for documents with ``\usepackage{booktabs}``.

        Parameters
        ----------
        label
            For references, such as ``tab:gamma``; letters, digits, colons and hyphens. "" for none.

        Examples
        --------
        >>> print(Table(("rate", "share"), (("a_1", "50 %"),), "Shares & rates").latex("tab:shares"))
        \begin{table}
          \centering
          \caption{Shares \& rates}
          \label{tab:shares}
          \begin{tabular}{lr}
            \toprule
            rate & share \\
            \midrule
            a\_1 & 50 \% \\
            \bottomrule
          \end{tabular}
        \end{table}
        <BLANKLINE>
        """
        align = "l" * min(self.labels, len(self.columns)) + "r" * (len(self.columns) - self.labels)
        named = [f"  \\label{{{re.sub('[^A-Za-z0-9:-]', '-', label)}}}"] if label else []
        note = [f"  \\par\\smallskip\\footnotesize {_in_latex(self.note)}"] if self.note else []
        lines = [
            r"\begin{table}",
            r"  \centering",
            f"  \\caption{{{_in_latex(self.caption)}}}",
            *named,
            f"  \\begin{{tabular}}{{{align}}}",
            r"    \toprule",
            _latex_row(self.columns),
            r"    \midrule",
            *map(_latex_row, self.rows),
            r"    \bottomrule",
            r"  \end{tabular}",
            *note,
            r"\end{table}",
        ]
        return "\n".join(lines) + "\n"

    def html(self) -> Markup:
        """Return it as HTML, whose text cannot become markup; numbers are of the class ``number``.

        Examples
        --------
        >>> Table(("a",), (("<b>",),), "One").html().partition("<tbody>")[2]
        Markup('<tr><th scope="row">&lt;b&gt;</th></tr></tbody></table>')
        """
        heads = Markup("").join(
            Markup('<th scope="col"{}>{}</th>').format(self._kind(i), head)
            for i, head in enumerate(self.columns)
        )
        rows = Markup("").join(Markup("<tr>{}</tr>").format(self._html_row(row)) for row in self.rows)
        table = Markup("<table><caption>{}</caption><thead><tr>{}</tr></thead><tbody>{}</tbody></table>")
        note = Markup('<p class="note">{}</p>').format(self.note) if self.note else Markup("")
        return table.format(self.caption, heads, rows) + note

    def _html_row(self, row: tuple[str, ...]) -> Markup:
        label, number = Markup('<th scope="row">{}</th>'), Markup('<td class="number">{}</td>')
        return Markup("").join(
            (label if i < self.labels else number).format(escape(cell)) for i, cell in enumerate(row)
        )

    def _kind(self, column: int) -> Markup:
        return Markup("") if column < self.labels else Markup(' class="number"')


def _markdown_row(cells: tuple[str, ...]) -> str:
    return f"| {' | '.join(map(_in_markdown, cells))} |"


def _in_markdown(text: str) -> str:
    return _MARKDOWN.sub(r"\\\1", _one_line(text))


def _latex_row(cells: tuple[str, ...]) -> str:
    return f"    {' & '.join(map(_in_latex, cells))} \\\\"


def _in_latex(text: str) -> str:
    # Two of these in a row would be read as one other sign, a dash for example.
    text = re.sub(r"(?<=[-`',!?])(?=[-`',])", "\0", _one_line(text))
    return "".join(_LATEX.get(sign, sign) for sign in text).replace("\0", "{}")


def _one_line(text: str) -> str:
    return _CONTROL.sub(" ", text).strip()

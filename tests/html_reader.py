"""Pages as a reader has them: their tags, ids, links and texts, and whether elements are well nested."""

from html.parser import HTMLParser

VOID = {"meta", "link", "img", "input", "br"}


class Reader(HTMLParser):
    """Collects a page's tags, ids, links, and texts outside of scripts and styles, and checks the nesting."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[str] = []
        self.ids: list[str] = []
        self.links: list[str] = []
        self.texts: list[str] = []
        self.feed(page)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note the element's tag, id and links."""
        self.tags.append(tag)
        self.ids += [value for name, value in attrs if name == "id" and value]
        self.links += [value for name, value in attrs if name in {"href", "xlink:href", "src"} and value]
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Treat ``<a/>`` as ``<a></a>``."""
        self.handle_starttag(tag, attrs)
        if tag not in VOID:
            self.handle_endtag(tag)

    def handle_endtag(self, tag: str) -> None:
        """Check that the innermost element is the one that ends."""
        assert self.open.pop() == tag, f"</{tag}> closes another element"

    def handle_data(self, data: str) -> None:
        """Keep texts that a reader sees."""
        if self.open and self.open[-1] not in {"script", "style"} and data.strip():
            self.texts.append(" ".join(data.split()))

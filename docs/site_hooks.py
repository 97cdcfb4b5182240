"""What mkdocs cannot be told in mkdocs.yml: pages of which there will be more."""

from pathlib import Path
from typing import Any

DOCS = Path(__file__).parent


def on_config(config: Any) -> Any:
    """The configuration of the site, with each decision, and guides that it lacks."""
    sections = {title: pages for entry in config.nav for title, pages in entry.items()}
    decisions = next(entry for entry in sections["Explanation"] if "Decisions" in entry)
    decisions["Decisions"] = ["decisions/index.md", *_pages("decisions", "0*.md")]
    listed = {page for entry in sections["How-to guides"] for page in entry.values()}
    sections["How-to guides"] += [p for p in _pages("how-to", "*.md") if p not in listed]
    return config


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """The list of decisions where it belongs."""
    if page.file.src_uri != "decisions/index.md":
        return markdown
    titles = (f"- [{_title(path)}]({Path(path).name})" for path in _pages("decisions", "0*.md"))
    return "\n".join([markdown, *titles])


def _pages(folder: str, pattern: str) -> list[str]:
    return sorted(f"{folder}/{path.name}" for path in (DOCS / folder).glob(pattern))


def _title(path: str) -> str:
    return (DOCS / path).read_text(encoding="utf-8").splitlines()[0].lstrip("# ")

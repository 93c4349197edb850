# Copyright 2026 flea_diag maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""An evaluation as HTML files that need nothing else: no network, no server, no script library.

The report lists every run. Each run that is drawn has a page of its own beside its details, so
that the report stays small however many runs there are.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from functools import cache
from importlib.resources import files
from typing import Any
from urllib.parse import quote

from flea_diag.errors import visible
from flea_diag.tools.campaign.run_result import RunResult
from flea_diag.tools.extra import require
from flea_diag.tools.score.report_drawing import number, picture, verdict
from flea_diag.tools.score.report_tables import report_tables

MOST_DRAWN = 400
"""Runs drawn; the page of each has about 70 kB."""
MOST_NAMED = 3
"""Members of a group that the table names; the drawing names all."""
MOST_WORDS = 120
"""Letters of a failure that the table shows."""
TOLD = ("kind", "configuration")
"""Columns that stand in the table only where the runs differ in them."""

Summary = Mapping[str, Any]


def to_draw(results: Sequence[RunResult], most: int = MOST_DRAWN) -> list[RunResult]:
    """Runs that are drawn: wrong ones first, then of each row in turn."""
    seen: Counter[tuple[str, str, str]] = Counter()
    ranked = []
    for result in results:
        if not result.failure:
            row = result.kind, result.row, result.configuration
            seen[row] += result.right
            ranked.append((seen[row] if result.right else 0, result))
    ranked.sort(key=lambda entry: entry[0])
    return [result for _, result in ranked[:most]]


def drawing_of(result: RunResult) -> str:
    """File of the run's drawing, relative to the report: beside its details."""
    return result.detail.removesuffix(".json") + ".html"


def page(
    title: str,
    made: str,
    results: Sequence[RunResult],
    summary: Summary,
    drawn: Collection[tuple[str, str, str]] = (),
) -> str:
    """The report.

    Parameters
    ----------
    made
        When it was written.
    summary
        As ``summary.summarise`` gives it.
    drawn
        Keys of the runs that have a drawing.

    Raises
    ------
    ConfigurationError
        Jinja2 is not installed.
    """
    told = [name for name in TOLD if len({getattr(result, name) for result in results}) > 1]
    return rendered(
        "report.html",
        title=title,
        made=made,
        summary=summary,
        tables=report_tables(summary),
        columns=_columns(told),
        results=[_line(result, told, result.key in drawn) for result in results],
        drawn_words=f"{len(drawn)} of {len(results)} runs are drawn, wrong ones first: "
        "the name leads to the drawing.",
    )


def drawing(result: RunResult, trace: Mapping[str, Any], before: str = "", after: str = "") -> str:
    """The page of one run, with links to the drawings before and after it."""
    back = "../" * drawing_of(result).count("/")
    return rendered(
        "drawing.html",
        run=picture(result, trace),
        back=f"{back}report.html",
        before=before and back + quote(before),
        after=after and back + quote(after),
    )


def neighbours(drawn: Sequence[RunResult]) -> list[tuple[RunResult, str, str]]:
    """Each run with the drawings before and after it, empty at the ends."""
    names = ["", *map(drawing_of, drawn), ""]
    return list(zip(drawn, names[:-2], names[2:], strict=True))


@cache
def _template(name: str) -> Any:
    require("evaluate", "the report")
    from jinja2 import Environment, FunctionLoader

    folder = files("flea_diag.tools.score").joinpath("templates")
    loader = FunctionLoader(lambda part: folder.joinpath(part).read_text("utf-8"))
    environment = Environment(autoescape=True, trim_blocks=True, loader=loader, finalize=_visible)
    return environment.get_template(name)


def _visible(value: object) -> object:
    """What a template writes, its control characters escaped; markup stays markup."""
    from markupsafe import Markup

    if isinstance(value, Markup):
        return Markup(visible(value))
    return visible(value) if isinstance(value, str) else value


def rendered(name: str, **given: Any) -> str:
    """A template of this package filled in; text is escaped.

    Raises
    ------
    ConfigurationError
        Jinja2 is not installed.
    """
    text: str = _template(name).render(**given)
    return text


def _columns(told: Sequence[str]) -> list[tuple[str, bool]]:
    """Headings of the table of runs, and whether a narrow window leaves them out."""
    return [
        ("run", False),
        *(({"configuration": "diagnoser"}.get(name, name), True) for name in told),
        ("truth", False),
        ("judged", False),
        ("answer", False),
        ("detected after (s)", False),
        ("final after (s)", False),
        ("features", True),
        ("CPU (s)", True),
    ]


def _line(result: RunResult, told: Sequence[str], drawn: bool) -> dict[str, Any]:
    failure = result.failure
    shortened = failure[:MOST_WORDS] + ("…" if len(failure) > MOST_WORDS else "")
    return {
        "id": result.id,
        "fold": result.fold,
        "truth": result.truth,
        "right": result.right,
        "link": quote(drawing_of(result)) if drawn else "",
        "told": [getattr(result, name) for name in told],
        "answer": shortened or verdict(result, MOST_NAMED),
        "detection": number(result.detection_time_s, "{:.2f}"),
        "isolation": number(result.isolation_time_s, "{:.2f}"),
        "features": f"{len(result.features_computed)}",
        "cpu": f"{result.cpu_s:.2f}",
    }

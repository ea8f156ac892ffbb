"""The report of a study: one HTML file with all figures inside, trials.csv, and on request a PDF."""

from __future__ import annotations

import base64
import io
import itertools
import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from coglab_py.packages import package_path

from coglab_tools.command import CheckFailed, plural
from coglab_tools.files import write_whole
from coglab_tools.report.metrics import METRICS
from coglab_tools.study.plan import Study
from coglab_tools.study.questionnaires import answers_of, scores_of
from coglab_tools.study.recordings import joined
from coglab_tools.study.rows import ROWS, open_rows, write_table
from coglab_tools.study.statistics import Comparison, compare, holm, wilson

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MOST_DRAWN = 60  # participants with a line in the figures and in the table of orders
MOST_LISTED = 400  # handovers in the report's table; trials.csv has all
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")


@dataclass(frozen=True)
class Measure:
    """One measure of the study: values by condition and participant (means over their handovers)."""

    title: str
    unit: str
    definition: str
    values: Mapping[str, Mapping[str, float]]


def write_report(study: Study, pdf: bool = False) -> dict[str, Any]:
    """Write report.html and trials.csv into the study's folder. Returns the verdict, the files, and the number of
    trials that are left. CheckFailed without a finished trial."""
    with open_rows(study) as rows:
        if not rows.trials:
            raise CheckFailed(f"{study.folder}: no trial of {study.name} is done: ./coglab study run {study.folder}")
        if not rows.table():
            raise CheckFailed(
                f"{study.folder / ROWS} has no handover: every trial so far ({len(rows.trials)}) was skipped; "
                f"./coglab study status {study.folder} shows what is left"
            )
        table, problems = joined(study, rows.table())
        done, header = len(rows.trials), rows.header or {}
        files = [str(write_table(study, table))]
    left = len(study.trials()) - done
    measures = [*_measures(study, table), *_scores(study)]
    verdict = _verdict(study, table, done, left)
    figures = [_outcome_figure(study, table), *_measure_figures(study, measures)]
    page = _page(study, table, measures, figures, verdict, header)
    write_whole(study.folder / "report.html", page.encode())
    files.insert(0, str(study.folder / "report.html"))
    if pdf:
        write_whole(study.folder / "report.pdf", _pdf(study, table, measures, figures, verdict))
        files.append(str(study.folder / "report.pdf"))
    return {
        "verdict": verdict,
        "files": files,
        "left": left,
        "problems": problems,
        "comparisons": list(_comparison_data(study, measures)),
    }


# --- numbers ------------------------------------------------------------------------------------------------------


def _verdict(study: Study, table: Sequence[Mapping[str, Any]], done: int, left: int) -> str:
    good, all_ = sum(int(row["success"]) for row in table), len(table)
    low, high = wilson(good, all_)
    people = len({row["participant"] for row in table})
    missing = f"; to do: {plural(left, 'trial')}" if left else ""
    return (
        f"{good} of {plural(all_, 'handover')} succeeded ({100 * good / all_:.1f} %, 95 % interval {100 * low:.1f} to "
        f"{100 * high:.1f} %), in {plural(done, 'trial')} with {plural(people, 'participant')}{missing}."
    )


def _measures(study: Study, table: Sequence[Mapping[str, Any]]) -> Iterator[Measure]:
    """Measures of the handovers that succeeded, one per action."""
    for action in dict.fromkeys(study.actions):
        for name, metric in METRICS.items():
            rows = [r for r in table if r["action"] == action and int(r["success"]) and r.get(name) not in (None, "")]
            if rows:
                triples = [(str(r["condition"]), str(r["participant"]), float(r[name])) for r in rows]
                yield _measure(study, f"{action}: {metric.label}", metric.unit, metric.definition, triples)


def _scores(study: Study) -> Iterator[Measure]:
    scores = scores_of(answers_of(study), study.questionnaires)
    for each in study.questionnaires:
        for scale, items in each.scales.items():
            own = [s for s in scores if s["questionnaire"] == each.name and s["scale"] == scale]
            if own:
                turned = [item for item in items if item in each.reversed]
                text = f"Mean of {', '.join(items)}" + (f"; reversed: {', '.join(turned)}" if turned else "")
                ends = f" {each.low:g} = {each.ends[0]}, {each.high:g} = {each.ends[1]}. {each.source}."
                triples = [(str(s["condition"]), str(s["participant"]), float(s["value"])) for s in own]
                unit = f"{each.low:g}-{each.high:g}"
                yield _measure(study, f"{each.title}: {scale.replace('_', ' ')}", unit, f"{text}.{ends}", triples)


def _measure(
    study: Study, title: str, unit: str, definition: str, triples: Sequence[tuple[str, str, float]]
) -> Measure:
    single: dict[tuple[str, str], list[float]] = {}
    for condition, person, value in triples:
        single.setdefault((condition, person), []).append(value)
    values = {
        condition: {
            person: float(np.mean(single[condition, person]))
            for person in study.participants
            if (condition, person) in single
        }
        for condition in study.conditions
    }
    return Measure(title, unit, definition, values)


def _comparisons(study: Study, measure: Measure) -> list[tuple[str, str, Comparison, float]]:
    """All pairs of conditions: (a, b, b - a, p after Holm over these pairs)."""
    found = []
    for a, b in itertools.combinations(study.conditions, 2):
        both = [p for p in study.participants if p in measure.values[a] and p in measure.values[b]]
        found.append((a, b, compare([measure.values[a][p] for p in both], [measure.values[b][p] for p in both])))
    corrected = holm([comparison.p for _, _, comparison in found])
    return [(*each, p) for each, p in zip(found, corrected, strict=True)]


def _comparison_data(study: Study, measures: Sequence[Measure]) -> Iterator[dict[str, Any]]:
    for measure in measures:
        for a, b, c, p in _comparisons(study, measure):
            numbers = {
                "difference": c.difference, "low": c.low, "high": c.high, "effect": c.effect,
                "effect_low": c.effect_low, "effect_high": c.effect_high, "p_holm": p,
            }  # fmt: skip
            plain = {name: value if math.isfinite(value) else None for name, value in numbers.items()}
            yield {"measure": measure.title, "unit": measure.unit, "from": a, "to": b, "pairs": c.pairs, **plain}


def _outcomes(study: Study, table: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    found = []
    for condition in study.conditions:
        for action in dict.fromkeys(study.actions):
            rows = [row for row in table if row["condition"] == condition and row["action"] == action]
            good = sum(int(row["success"]) for row in rows)
            low, high = wilson(good, len(rows))
            reasons = Counter(row["reason_code"] or row["outcome"] for row in rows if not int(row["success"]))
            found.append(
                {
                    "condition": condition,
                    "action": action,
                    "n": len(rows),
                    "good": good,
                    "rate": good / len(rows) if rows else math.nan,
                    "low": low,
                    "high": high,
                    "reasons": ", ".join(f"{reason} ({count})" for reason, count in reasons.most_common()),
                }
            )
    return found


# --- figures ------------------------------------------------------------------------------------------------------


def _outcome_figure(study: Study, table: Sequence[Mapping[str, Any]]) -> Figure:
    from matplotlib.figure import Figure

    actions = list(dict.fromkeys(study.actions))
    outcomes = _outcomes(study, table)
    figure = Figure(figsize=(max(5.0, 1.2 * len(study.conditions) * len(actions)), 3.2), layout="constrained")
    axes = figure.add_subplot()
    for k, action in enumerate(actions):
        own = [each for each in outcomes if each["action"] == action and each["n"]]
        names = list(study.conditions)
        x = [names.index(each["condition"]) + 0.18 * (k - (len(actions) - 1) / 2) for each in own]
        rate = np.array([100 * each["rate"] for each in own])
        low = np.maximum(0.0, rate - [100 * each["low"] for each in own])
        high = np.maximum(0.0, [100 * each["high"] for each in own] - rate)
        axes.errorbar(x, rate, [low, high], fmt="o", capsize=4, color=COLOURS[k % len(COLOURS)], label=action)
    axes.set_xticks(range(len(study.conditions)), list(study.conditions))
    axes.set_xlim(-0.6, len(study.conditions) - 0.4)
    axes.set_ylim(-3, 103)
    axes.set_ylabel("success [%]")
    axes.set_title("Handovers that succeeded, with Wilson 95 % intervals", fontsize=10)
    axes.grid(axis="y", alpha=0.3)
    axes.legend(fontsize=8, loc="lower left")
    return figure


def _measure_figures(study: Study, measures: Sequence[Measure]) -> Iterator[Figure]:
    """A figure for each action and questionnaire, with small charts: participants' means as lines over the conditions,
    mean and 95 % interval."""
    from matplotlib.figure import Figure
    from scipy.stats import t

    for _, group in itertools.groupby(measures, lambda measure: measure.title.partition(":")[0]):
        shown = list(group)
        rows = math.ceil(len(shown) / 4)
        figure = Figure(figsize=(12, 2.6 * rows), layout="constrained")
        for place, measure in enumerate(shown, 1):
            axes = figure.add_subplot(rows, 4, place)
            names = list(study.conditions)
            for person in study.participants[:MOST_DRAWN]:
                own = [(x, measure.values[n][person]) for x, n in enumerate(names) if person in measure.values[n]]
                if own:
                    axes.plot(*zip(*own, strict=True), color="0.75", linewidth=0.8, marker=".", markersize=3)
            for x, name in enumerate(names):
                values = np.array(list(measure.values[name].values()))
                if len(values):
                    n = len(values)
                    half = float(t.ppf(0.975, n - 1)) * values.std(ddof=1) / math.sqrt(n) if n > 1 else 0.0
                    colour = COLOURS[x % len(COLOURS)]
                    axes.errorbar(x, values.mean(), half, fmt="o", capsize=4, color=colour, zorder=3)
            axes.set_xticks(range(len(names)), names, fontsize=8, rotation=0 if len(names) < 4 else 30)
            axes.set_xlim(-0.5, len(names) - 0.5)
            axes.tick_params(axis="y", labelsize=8)
            axes.set_title(measure.title + (f" [{measure.unit}]" if measure.unit else ""), fontsize=9)
            axes.grid(axis="y", alpha=0.3)
        yield figure


def _svg(figure: Figure) -> str:
    """The figure as a data address of an SVG picture."""
    import matplotlib

    target = io.BytesIO()
    with matplotlib.rc_context({"svg.hashsalt": "coglab"}):
        figure.savefig(target, format="svg", metadata={"Date": None})
    return "data:image/svg+xml;base64," + base64.b64encode(target.getvalue()).decode()


def _pdf(
    study: Study,
    table: Sequence[Mapping[str, Any]],
    measures: Sequence[Measure],
    figures: Sequence[Figure],
    verdict: str,
) -> bytes:
    """Figures and tables as pages of a PDF."""
    from matplotlib.backends.backend_pdf import PdfPages
    from matplotlib.figure import Figure

    lines = [
        f"{o['condition']:<24}{o['action']:<10}{o['good']:>5} of {o['n']:<5} "
        f"{_interval(100 * o['rate'], 100 * o['low'], 100 * o['high'])} %   {o['reasons']}"
        for o in _outcomes(study, table)
    ]
    lines += ["", f"{'comparison':<64}{'n':>4}   {'difference':<28}{'g of pairs':<26}p (Holm)"]
    for measure in measures:
        for a, b, c, p in _comparisons(study, measure):
            lines.append(
                f"{measure.title[:34]:<36}{a} to {b:<18}"[:64].ljust(64)
                + f"{c.pairs:>4}   {_interval(c.difference, c.low, c.high):<28}"
                + f"{_interval(c.effect, c.effect_low, c.effect_high):<26}{_p(p)}"
            )
    target = io.BytesIO()
    with PdfPages(target, metadata={"Title": f"Study {study.name}", "CreationDate": None}) as pages:
        for start in range(0, len(lines), 60):
            page = Figure(figsize=(11.7, 8.3))
            head = f"Study {study.name}\n{verdict}" if start == 0 else f"Study {study.name}"
            page.text(0.04, 0.96, head, fontsize=10, va="top", weight="bold")
            page.text(0.04, 0.89, "\n".join(lines[start : start + 60]), fontsize=6.5, va="top", family="monospace")
            pages.savefig(page)
        for figure in figures:
            pages.savefig(figure)
    return target.getvalue()


# --- page ---------------------------------------------------------------------------------------------------------


def _number(value: float) -> str:
    if not math.isfinite(value):
        return "–"
    return f"{value:.3f}" if abs(value) < 10 else f"{value:.1f}"


def _p(value: float) -> str:
    return "< 0.001" if value < 0.001 else _number(value)


def _interval(value: float, low: float, high: float) -> str:
    if not math.isfinite(low):
        return _number(value)
    return f"{_number(value)} [{_number(low)}, {_number(high)}]"


def _page(
    study: Study,
    table: Sequence[Mapping[str, Any]],
    measures: Sequence[Measure],
    figures: Sequence[Figure],
    verdict: str,
    header: Mapping[str, Any],
) -> str:
    import jinja2

    names = list(study.conditions)
    summary = []
    for measure in measures:
        cells = []
        for name in names:
            values = np.array(list(measure.values[name].values()))
            spread = f" ± {_number(float(values.std(ddof=1)))}" if len(values) > 1 else ""
            cells.append(f"{_number(float(values.mean()))}{spread}" if len(values) else "–")
        summary.append((measure, cells))
    compared = [(measure, _comparisons(study, measure)) for measure in measures]
    orders: dict[str, dict[tuple[int, str], None]] = {}
    for trial in study.trials():
        orders.setdefault(trial.participant, {})[trial.block, trial.condition] = None
    environment = jinja2.Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True)
    environment.filters |= {"number": _number, "p": _p, "plural": plural}
    environment.globals |= {"interval": _interval}
    template = package_path("coglab_tools", "templates", "study_report.html").read_text(encoding="utf-8")
    return environment.from_string(template).render(
        study=study,
        verdict=verdict,
        kind="simulated, in virtual time" if header.get("simulated", True) else "live",
        identity=header.get("identity", {}),
        outcomes=_outcomes(study, table),
        names=names,
        summary=summary,
        compared=compared,
        figures=[_svg(figure) for figure in figures],
        orders=dict(itertools.islice(orders.items(), MOST_DRAWN)),
        rows=table[:MOST_LISTED],
        more=max(0, len(table) - MOST_LISTED),
        columns=[name for name in METRICS if any(name in row for row in table)],
        metrics=METRICS,
    )

"""The report: drawings that are well formed, scales that are right, pages that need no network."""

import math
import re
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hindrax_analysis.coefficients_file import MOCK_WORLD, ResultConditions, SavedCoefficients, conditions_of
from hindrax_analysis.identification.verdict import shared
from hindrax_analysis.published import CITATION, PUBLISHED, published_of
from hindrax_analysis.report.chart import (
    Band,
    Bars,
    Chart,
    Line,
    Points,
    Scale,
    Stems,
    data_range,
    drawing,
    figure,
    thinned,
    tick_text,
    ticks,
)
from hindrax_analysis.report.comparison import comparison_page, pool_runs
from hindrax_analysis.report.figures import MotionFigures, Trace, charts_of, comparable_methods
from hindrax_analysis.report.forest import Entry, forest
from hindrax_analysis.report.html_elements import plus_minus, table
from hindrax_analysis.report.report_tables import dimensionless, reynolds_text, table_3, table_budget, table_methods
from hindrax_analysis.report.run_page import RunReport, _facts, _how_to_read, run_page
from hindrax_analysis.testing.browser import browser, browser_at_hand
from hindrax_core.vehicle import Vehicle
from hindrax_ident.arrays import array
from hindrax_ident.assess.objections import unnamed
from hindrax_ident.assess.results import Contribution, DragBand, MotionResult, Number, Results, truth_of, with_truth
from hindrax_ident.model.motion_model import model_of
from hindrax_ident.online.session import Outcome, Session
from hindrax_ident.testing.synthetic_runs import DVL, back_and_forth, events, fly

finite = st.floats(-1e6, 1e6, allow_nan=False)
LONGEST_LABEL = 30
"""Characters of a label along the height of a chart on a phone."""


@pytest.fixture(scope="module")
def outcome(vehicle: Vehicle) -> Outcome:
    model = model_of(vehicle, 0)
    flight = fly(model, np.array([66.48, 1.25, 0.0, 27.3]), back_and_forth((3.0, 8.0, 14.0), 8.0, 96.0), 0.15)
    session = Session(vehicle)
    for event in events(flight, 0, "surge", DVL, np.random.default_rng(1), plateau_s=4.0):
        session.step(event)
    return session.finalize()


@pytest.fixture(scope="module")
def report(vehicle: Vehicle, outcome: Outcome) -> RunReport:
    t = array(np.linspace(0.0, 90.0, 50))
    names = ("k_q", "k_l", "b", "added_mass")
    falling = np.column_stack([np.exp(-t)] * len(names))
    trace = Trace(names, t, 10.0 + falling, falling)
    reported = conditions_of(vehicle, mock=True, motions=("surge",))
    results = with_truth(outcome.results, truth_of(vehicle))
    return RunReport(results, outcome.assessments, reported, {"surge": trace}, [a_run("last week", 66.0)])


def a_run(label: str, k_q: float, std: float = 0.5, *, identifiable: bool = True) -> SavedCoefficients:
    numbers = {"k_q": Number(k_q, std, 2.0 * std, unit="N s^2/m^2"), "k_l": Number(1.0, 0.1, unit="N s/m")}
    blank = ResultConditions("hindrax", 15.0, 0.015, 0.6, 1000.0, 1e-6, mock=False)
    return SavedCoefficients(label, blank, {"surge": MotionResult("surge", "", numbers, identifiable, (), (0.1, 0.4))})


def main_of(page: str) -> str:
    found = re.search(r"<main>.*</main>", page, flags=re.DOTALL)
    assert found is not None
    return found.group()


# ---- scales


@settings(deadline=None)
@given(finite, st.floats(1e-6, 1e6))
def test_ticks_are_round_within_the_range_and_a_handful(low: float, width: float) -> None:
    high = low + width
    if not high > low + 1e-9 * abs(low):
        return
    marks = ticks(low, high)
    assert 2 <= len(marks) <= 7
    assert all(low - 1e-6 * width <= mark <= high + 1e-6 * width for mark in marks)
    steps = np.diff(marks)
    assert np.allclose(steps, steps[0], rtol=1e-3)


@settings(deadline=None)
@given(finite, st.floats(1e-3, 1e5))
def test_tick_texts_distinguish_ticks(low: float, width: float) -> None:
    marks = ticks(low, low + width)
    if width > 1e-4 * abs(low):
        texts = [tick_text(mark, marks) for mark in marks]
        assert len(set(texts)) == len(texts)


def test_a_scale_maps_its_ends() -> None:
    scale = Scale(-1.0, 1.0, 10.0, 20.0)
    assert scale(np.array([-1.0, 0.0, 1.0])).tolist() == [10.0, 15.0, 20.0]


def test_a_range_ignores_what_is_not_finite() -> None:
    low, high = data_range([np.array([1.0, math.nan, 3.0, math.inf])])
    assert low < 1.0
    assert 3.0 < high < 4.0
    assert data_range([np.array([math.nan])]) == (0.0, 1.0)


@settings(deadline=None)
@given(st.integers(2000, 5000), st.integers(0, 2**31))
def test_a_thinned_line_keeps_its_extremes(count: int, seed: int) -> None:
    y = np.random.default_rng(seed).standard_normal(count)
    x, kept = thinned(array(np.arange(float(count))), y)
    assert len(x) < count
    assert kept.min() == y.min()
    assert kept.max() == y.max()
    assert np.all(np.diff(x) > 0.0)


# ---- drawings


def test_every_layer_makes_well_formed_svg_inside_the_frame() -> None:
    x = array(np.linspace(0.0, 1.0, 30))
    hole = np.where(x > 0.5, math.nan, x)
    layers = (
        Band(x, np.stack([hole - 1.0, hole + 1.0]), "model", "band", "faint"),
        Line(x, hole, "model", "line", "dashed"),
        Points(x, x, "measured", "dots"),
        Bars(array(np.linspace(0, 1, 4)), np.array([1.0, 2.0, 3.0]), "measured", "bars"),
        Stems(x, x, "measured", "stems"),
    )
    text = drawing(Chart("a < b & c", "x [m]", "y [s]", "What it shows.", layers))
    root = ET.fromstring(text)
    assert root.attrib["aria-label"] == "a < b & c"
    assert "nan" not in text
    assert "inf" not in text


def test_a_chart_without_any_point_is_still_a_chart() -> None:
    empty = np.zeros(0)
    ET.fromstring(drawing(Chart("none", "x", "y", "c", (Line(empty, empty, "model"), Points(empty, empty, "model")))))


def test_a_figure_escapes_its_words() -> None:
    text = figure(Chart("<b>", "x", "y", "1 < 2", (Line(np.zeros(2), np.ones(2), "model"),)))
    assert "<b>" not in text
    assert "1 &lt; 2" in text


def test_an_unidentified_run_does_not_spoil_the_frame_of_the_others() -> None:
    good = [Entry("one", Number(66.0, 0.3, 1.0), "model"), Entry("two", Number(67.0, 0.3, 1.0), "model")]
    wild = Entry("wild", Number(980.0, 1700.0, 1700.0), "earlier", excluded=True)
    frame = re.compile(r'class="tick" x="([\d.]+)"[^>]*>([^<]+)<')
    with_it, without = (forest("k_q", "N", rows, "caption") for rows in ([*good, wild], good))
    assert frame.findall(with_it) == frame.findall(without)
    assert 'class="stem earlier"' in with_it
    assert 'class="stem' not in without


def test_a_forest_keeps_every_source_in_the_frame() -> None:
    entries = [
        Entry("a", Number(1.0, 0.1, 0.2), "model"),
        Entry("b", Number(1.1, 1e9), "paper"),
        Entry("c", Number(math.nan, 1, 1), "model"),
    ]
    text = forest("k_q", "N", entries, "caption", 1.05)
    ET.fromstring(text)
    assert text.count('class="name"') == 2


# ---- numbers in words


@pytest.mark.parametrize(
    ("pair", "text"),
    [
        ((66.679, 0.2153), "66.68 \u00b1 0.22"),
        ((-0.0021, 0.0048), "\u22120.0021 \u00b1 0.0048"),
        ((1234.5, 56.0), "1234 \u00b1 56"),
        ((0.12345, 0.000996), "0.1235 \u00b1 0.0010"),
        ((9.962, math.nan), "9.96"),
        ((math.inf, math.nan), "inf"),
    ],
)
def test_a_value_has_two_digits_of_its_deviation(pair: tuple[float, float], text: str) -> None:
    assert plus_minus(*pair) == text


def test_the_deviation_to_quote_comes_first_and_gives_the_digits() -> None:
    assert plus_minus(2.3379, 0.0050, 0.0471) == "2.338 \u00b1 0.047 <small>noise \u00b1 0.0050</small>"
    assert plus_minus(2.3379, math.nan, 0.0471) == "2.338 \u00b1 0.047"
    assert plus_minus(2.3379, math.nan, math.nan) == plus_minus(2.3379, math.nan)


def test_no_negative_zero() -> None:
    assert plus_minus(-0.0001, 0.02) == "0.000 \u00b1 0.020"


def test_the_drag_coefficients_of_table_3_are_those_of_table_4(vehicle: Vehicle) -> None:
    """COB-2023-1394: the rows of Table 3 over their Reynolds numbers give the printed C_D within its deviation."""
    for motion in ("surge", "sway", "heave_down", "heave_up"):
        paper = PUBLISHED[motion]
        length, nu = vehicle.characteristic_length_m, vehicle.water.kinematic_viscosity_m2ps
        low, high = (reynolds * nu / length for reynolds in paper.reynolds)
        speed = array(np.linspace(low, high, 50))
        force = paper.in_our_axes["k_q"][0] * speed**2 + paper.in_our_axes["k_l"][0] * speed
        band = DragBand(speed, force, 0.0 * speed, 0.0 * speed)
        found = dimensionless(vehicle, a_motion(motion, band))
        assert found is not None
        assert abs(found.mean[0] - paper.drag_coefficient[0]) < paper.drag_coefficient[1]
        assert found.reynolds[-1] == pytest.approx(paper.reynolds[1])


def a_motion(motion: str, band: DragBand | None) -> MotionResult:
    return MotionResult(motion, "", {}, identifiable=True, drag=band)


@pytest.mark.parametrize(
    ("reynolds", "printed"),
    [(9.96e4, "1.0 \u00d7 10\u2075"), (9.94e4, "9.9 \u00d7 10\u2074"), (0.25, "2.5 \u00d7 10\u207b\u00b9"), (0.0, "0")],
)
def test_a_reynolds_number_has_one_digit_before_the_point(reynolds: float, printed: str) -> None:
    assert reynolds_text(reynolds) == printed


@pytest.mark.parametrize(("count", "text"), [(1.0, "1 plateau<"), (10.0, "10 plateaus<")])
def test_one_plateau_is_no_plateaus(count: float, text: str) -> None:
    assert text in _facts(replace(a_motion("surge", None), quality={"plateaus": count}))


def test_drag_by_the_speed_across_has_its_column_where_a_record_has_any(vehicle: Vehicle) -> None:
    numbers = {"k_q": Number(60.0, 1.0), "k_w": Number(71.0, 9.0)}
    surge = replace(a_motion("surge", None), coefficients=numbers)
    page = table_3(Results({"surge": surge, "heave_down": a_motion("heave_down", None)}, vehicle))
    assert "k<sub>w</sub> [N\u00b7s\u00b2/m\u00b2]" in page
    assert "71.0 \u00b1 9.0" in page
    assert page.count("k<sub>w</sub>") == 2, "its head, and the cell of surge"


def test_a_warning_about_many_motions_is_reported_once() -> None:
    wide, late = unnamed("most of the band comes from the tether"), unnamed("the stamps are late")
    motions = {
        name: replace(a_motion(name, None), warnings=warnings)
        for name, warnings in {"surge": (late, wide), "sway": (wide,), "heave": (), "yaw": (late, wide)}.items()
    }
    assert shared({name: one.warnings for name, one in motions.items()}) == [
        (["surge", "yaw"], late),
        (["surge", "sway", "yaw"], wide),
    ]
    assert shared({"heave": motions["heave"].warnings}) == []


def test_plateaus_are_not_shown_of_a_motion_that_rights_itself() -> None:
    methods = {"plateaus": {"k_q": Number(-3.0, 3.0)}, "rls": {"k_q": Number(1.2, 0.1)}}
    roll = replace(
        a_motion("roll", None), method="output-error", methods=methods, coefficients={"k_q": Number(1.2, 0.1)}
    )
    assert "plateaus (paper's way)" in table_methods(roll)
    righted = replace(roll, coefficients={"k_q": Number(1.2, 0.1), "k_r": Number(3.0, 0.1)})
    assert set(comparable_methods(righted)) == {"rls"}
    assert "plateaus (paper's way)" not in table_methods(righted)
    assert "Plateaus are omitted" in table_methods(righted)


@pytest.mark.parametrize(("motion", "force", "mass"), [("surge", "N", "kg"), ("yaw", "N\u00b7m", "kg\u00b7m\u00b2")])
def test_every_column_of_the_budget_has_its_unit_and_why_the_rows_do_not_add_up_is_reported(
    motion: str, force: str, mass: str
) -> None:
    budget = {name: [Contribution("inflow loss", 0.5, "")] for name in ("drag", "added_mass")}
    page = table_budget(replace(a_motion(motion, None), budget=budget))
    assert f">drag at the highest speed [{force}]<" in page
    assert f">added mass [{mass}]<" in page
    assert "do not add up in squares" in page


def test_a_budget_has_two_digits_and_no_row_without_a_number() -> None:
    parts = [Contribution("drag of the tether", 120.4, ""), Contribution("inflow loss", 30.0, "")]
    motion = replace(
        a_motion("surge", None),
        coefficients={"k_q": Number(60.0, 1.0, 130.0)},
        budget={"k_q": [*parts, Contribution("tilt of the mount", 0.1, "align it")]},
    )
    page = table_budget(motion)
    assert re.findall(r"</span>([\d.+e]+)</td>", page) == ["130", "120", "30"]
    assert "tilt of the mount" not in page


# ---- pages


def test_the_label_of_a_motion_leads_to_it(report: RunReport) -> None:
    page = run_page(report)
    assert '<a class="chip good" href="#surge">Surge: identified</a>' in page
    assert page.count('id="surge"') == 1


def test_a_plot_of_methods_says_which_of_its_marks_are_corrected(report: RunReport) -> None:
    surge = report.results.motions["surge"]
    said = "Dot and thin line are corrected"
    fitted = {name: replace(number, corrected=None) for name, number in surge.coefficients.items()}
    plain = replace(report, results=replace(report.results, motions={"surge": replace(surge, coefficients=fitted)}))
    assert said in run_page(report)
    assert said not in run_page(plain)


@pytest.mark.skipif(browser_at_hand() is None, reason="needs a browser: chromium or google-chrome on the PATH")
def test_no_table_is_wider_than_its_page_and_no_number_than_its_box(report: RunReport, tmp_path: Path) -> None:
    cut = replace(a_run("2026-01-31_14-00-00", 66.0), conditions=replace(a_run("", 1.0).conditions, aborted=BOUNDS))
    turning = array([0.3, 0.69])
    drag = DragBand(turning, array([0.2, 0.7634]), array([0.02, 0.05]), array([0.1, 0.2123]))
    swings = Results({motion: a_motion(motion, drag) for motion in ("roll", "pitch")}, report.results.vehicle)
    pages = {
        "run": run_page(report),
        "swings": run_page(replace(report, results=swings, assessments={})),
        "two runs": comparison_page([a_run("2026-01-31_13-00-00", 66.0), a_run("second", 67.0)]),
        "comparison": comparison_page([a_run("2026-01-31_13-00-00", 66.0), cut, a_run("a name " * 9, 67.0)]),
    }
    cut_off = """[...document.querySelectorAll('figure text')].filter(one => {
        const text = one.getBoundingClientRect(), card = one.closest('figure').getBoundingClientRect()
        return text.left < card.left || text.right > card.right}).length"""
    boxes = "[...document.querySelectorAll('.scroll, .headline div')]"
    outside = f"{boxes}.filter(one => one.scrollWidth > one.clientWidth).length"
    with browser(str(browser_at_hand()), tmp_path / "profile") as seen:
        for name, text in pages.items():
            (tmp_path / f"{name}.html").write_text(text, encoding="utf-8")
            for width in (1280, 1024, 768, 390):
                seen.look(width, 900)
                seen.open((tmp_path / f"{name}.html").as_uri())
                seen.wait("document.readyState === 'complete'")
                assert seen.run("document.querySelectorAll('.scroll').length") > 1
                assert seen.run(outside) == 0, (name, width)
                assert seen.run(cut_off) == 0, (name, width)


def test_the_paper_is_cited_once_and_in_full(report: RunReport) -> None:
    for text in (run_page(report), comparison_page([a_run("first", 66.0), a_run("second", 67.0)])):
        assert text.count(CITATION) == 1
    strange = [replace(run, conditions=replace(run.conditions, vehicle="lbv")) for run in (a_run("one", 1.0),)]
    assert "COB-2023-1394" not in comparison_page(strange)


def test_every_chart_has_units_and_one_sentence(report: RunReport, vehicle: Vehicle) -> None:
    result = report.results.motions["surge"]
    charts = charts_of(MotionFigures(vehicle, result, report.assessments[0], report.traces["surge"]))
    assert len(charts) >= 11
    for chart in charts:
        assert "[" in chart.x_label, chart.title
        assert "[" in chart.y_label, chart.title
        assert len(chart.y_label) <= LONGEST_LABEL, chart.title
        assert re.fullmatch(r"[A-Z].*\.", chart.caption), chart.title
        assert not re.search(r"\. [A-Z]", chart.caption), chart.title


def test_the_first_estimates_do_not_flatten_what_the_online_estimate_converges_to(
    report: RunReport, vehicle: Vehicle
) -> None:
    t = array(np.linspace(0.0, 30.0, 100))
    std = np.where(t < 12.0, 14.0, 0.05)
    trace = Trace(("k_q",), t, np.full((100, 1), 66.0), std[:, None])
    figures = MotionFigures(vehicle, report.results.motions["surge"], report.assessments[0], trace)
    (chart,) = (one for one in charts_of(figures) if one.title == "Online estimate of k_q")
    assert chart.y_range is not None
    assert chart.y_range[1] - chart.y_range[0] < 4.0


def test_on_a_phone_every_number_stands_under_its_heading() -> None:
    page = table(["run", "k<sub>q</sub>", "verdict"], [["first", "66.5", ""]])
    assert '<td><span class="head">k<sub>q</sub></span>66.5</td><td></td>' in page


def test_what_was_not_fitted_is_predicted_beside_those_who_know_nothing(report: RunReport) -> None:
    """The flight is exact but for the noise and rounding of the DVL: its model errs by no more than they do."""
    text = re.sub(r"<span class=.head.>[^<]*</span>", "", run_page(report).replace("<code>", ""))
    (row,) = re.findall(r"Surge</td><td>\d+</td>" + r"<td>([\d.]+)</td>" * 3 + "<td>m/s</td>", text)
    model, still, steady = map(float, row)
    checked = report.assessments[0].validation
    assert checked is not None
    assert still == pytest.approx(np.sqrt(np.mean(checked.prediction.measured**2)), rel=0.01)
    assert model < 0.02
    assert min(still, steady) > 0.1
    assert f"model {model:.2g}, stays still {still:.2g}" in text, "the plot tells the same"


def test_the_page_needs_nothing_but_itself(report: RunReport) -> None:
    text = run_page(report)
    assert not re.search(r"(https?:)?//[a-z]", text.replace("data:,", ""))
    assert "<script" not in text
    assert "prefers-color-scheme:dark" in text
    assert "@media print" in text
    assert 'name="viewport"' in text
    assert "nan" not in re.sub(r"<style>.*</style>", "", text, flags=re.DOTALL)


def test_the_page_shows_paper_truth_methods_and_earlier_runs(report: RunReport) -> None:
    text = run_page(report)
    for word in (
        "66.48 \u00b1 10.20",
        "2.28 \u00b1 0.21",
        "truth of the mock",
        "mock vehicle",
        "last week",
        "paper's way",
    ):
        assert word in text, word
    assert text.count("<svg viewBox") >= 15


def test_the_page_is_well_formed(report: RunReport) -> None:
    ET.fromstring(main_of(run_page(report)))


def test_the_same_run_gives_the_same_page(report: RunReport) -> None:
    assert run_page(report) == run_page(report)


def test_a_comparison_shows_every_run_and_their_mean() -> None:
    text = comparison_page(
        [a_run("monday", 66.0), a_run("tuesday", 67.0), a_run("bad <day>", 10.0, identifiable=False)]
    )
    ET.fromstring(main_of(text))
    for word in (
        "monday",
        "tuesday",
        "bad &lt;day&gt;",
        "66.5 \u00b1 1.0 <small>noise \u00b1 0.50</small>",
        "not identifiable",
    ):
        assert word in text, word


def test_runs_that_disagree_widen_their_mean() -> None:
    agreeing = pool_runs([Number(1.0, 0.1), Number(1.05, 0.1), Number(0.95, 0.1)])
    disagreeing = pool_runs([Number(1.0, 0.1), Number(2.0, 0.1), Number(0.0, 0.1)])
    assert agreeing is not None
    assert disagreeing is not None
    assert agreeing.std == pytest.approx(0.1 / math.sqrt(3.0))
    assert disagreeing.std == pytest.approx(0.1 / math.sqrt(3.0) * 10.0)
    assert pool_runs([Number(1.0, 0.1)]) is None


@pytest.mark.parametrize(("name", "shown"), [("hindrax", True), ("Hindrax two", True), ("bluerov2", False)])
def test_the_paper_stands_beside_its_own_vehicle_only(name: str, shown: bool) -> None:
    assert (published_of(name, "surge") is not None) == shown


def test_the_tables_name_the_paper_only_where_its_rows_stand_beside_ours(report: RunReport) -> None:
    other = replace(report.results.vehicle, name="lbv")
    strange = run_page(replace(report, results=replace(report.results, vehicle=other)))
    assert ">Coefficients, next to Table 3 of COB-2023-1394</h2>" in run_page(report)
    assert ">Coefficients</h2>" in strange
    assert "of COB-2023-1394" not in strange


def test_the_coefficients_have_the_units_of_the_motions_that_were_flown() -> None:
    vehicle = Vehicle("lbv", 10.0, 0.01, (0.5, 0.4, 0.3))
    surge, yaw = a_motion("surge", None), a_motion("yaw", None)
    assert "b [N]<" in table_3(Results({"surge": surge}, vehicle))
    assert "b [N\u00b7m]<" in table_3(Results({"yaw": yaw}, vehicle))
    assert "b [N or N\u00b7m]<" in table_3(Results({"surge": surge, "yaw": yaw}, vehicle))


def test_the_restoring_moment_of_what_rights_itself_is_in_model_and_table(report: RunReport) -> None:
    numbers = {name: Number(1.2, 0.1) for name in ("k_q", "k_l", "b", "added_mass")}
    surge = replace(a_motion("surge", None), coefficients=numbers)
    roll = replace(a_motion("roll", None), coefficients=numbers | {"k_r": Number(3.5, 0.11, 1.3, truth=3.06)})
    both = Results({"surge": surge, "roll": roll}, report.results.vehicle)
    table = table_3(both)
    assert ">k<sub>r</sub> [N\u00b7m]<" in table
    assert "3.5 \u00b1 1.3 <small>noise \u00b1 0.11</small>" in table
    assert "<small>3.06</small>" in table
    assert "not found" not in table
    assert "k<sub>r</sub>" in _how_to_read(replace(report, results=both))
    straight = Results({"surge": surge}, report.results.vehicle)
    assert "k<sub>r</sub>" not in table_3(straight) + _how_to_read(replace(report, results=straight))


def test_a_command_in_a_sentence_is_shown_as_code(report: RunReport) -> None:
    text = run_page(replace(report, conditions=replace(report.conditions, aborted="x: ask `./hindrax doctor`")))
    assert "ask <code>./hindrax doctor</code>" in text


# ---- aborted


BOUNDS = "pool_bounds: 0.4 m to the <wall>; give it room, or ask `./hindrax doctor`"


def aborted(report: RunReport, flown_s: dict[str, float] | None = None) -> RunReport:
    return replace(report, conditions=replace(report.conditions, aborted=BOUNDS, flown_s=flown_s or {}))


def test_an_aborted_run_states_by_what_and_what_was_flown_until_then(report: RunReport) -> None:
    text = run_page(aborted(report, flown_s={"surge": 20.4}))
    ET.fromstring(main_of(text))
    assert '<span class="chip bad">aborted: pool_bounds</span>' in text
    assert "Aborted by pool_bounds: 0.4 m to the &lt;wall&gt;; give it room" in text
    assert "Flown until then: Surge for 20 s." in text
    assert "borted" not in run_page(report)
    assert "Flown until then: no part of a motion." in run_page(aborted(report))


def test_a_wall_that_was_pushed_against_is_in_the_report(report: RunReport) -> None:
    text = run_page(replace(report, conditions=replace(report.conditions, blocked_s={"surge": 3.6})))
    assert (
        "Thrust moved nothing, as against a wall: Surge for 4 s. That and the time before it are not in the data."
        in text
    )
    assert "as against a wall" not in run_page(report)


@pytest.mark.parametrize(
    ("sentence", "guard"),
    [
        ("start: dvl_lock: no bottom lock for 7 s", "start: dvl_lock"),
        ("operator: stopped by Ctrl-C", "operator"),
        ("no colon", "no colon"),
    ],
)
def test_the_chip_names_the_guard(report: RunReport, sentence: str, guard: str) -> None:
    text = run_page(replace(report, conditions=replace(report.conditions, aborted=sentence)))
    assert f'<span class="chip bad">aborted: {guard}</span>' in text


def test_a_run_in_which_nothing_was_flown_reports_it_and_shows_no_tables(report: RunReport) -> None:
    text = run_page(replace(aborted(report), results=replace(report.results, motions={}), traces={}, assessments={}))
    ET.fromstring(main_of(text))
    assert "Nothing was flown" in text
    assert ">Coefficients" not in text


def test_a_comparison_and_a_forest_mark_the_aborted_run(report: RunReport) -> None:
    cut = a_run("cut short", 67.0)
    cut = replace(cut, conditions=replace(cut.conditions, aborted=BOUNDS))
    text = comparison_page([a_run("monday", 66.0), cut])
    assert '<span class="chip bad">aborted: 1 of 2 runs</span>' in text
    assert "vehicle, aborted by pool_bounds: 0.4 m to the &lt;wall&gt;" in text
    assert "<code>./hindrax doctor</code>" in text
    assert "cut short (aborted)" in run_page(replace(report, earlier=[cut]))


def test_what_was_predicted_stands_beside_what_was_reached(report: RunReport) -> None:
    text = run_page(replace(report, conditions=replace(report.conditions, predicted={"surge": 0.0412})))
    assert re.search(r"4\.1% predicted, \d+\.\d% reached", text)
    assert "predicted, " not in run_page(report)


def test_a_thruster_that_was_left_out_stands_at_the_top(report: RunReport) -> None:
    out = "T3: 82 % of its thrust is missing, left out from 18 s on"
    text = run_page(replace(report, conditions=replace(report.conditions, left_out=(out,))))
    assert '<span class="chip bad">left out: T3</span>' in text
    assert f"<b>{out}.</b>" in text
    assert "left out" not in run_page(report)


def test_the_world_of_a_mock_stands_in_the_conditions_and_other_assumptions_above_the_tables(report: RunReport) -> None:
    assumptions = (f"{MOCK_WORLD}: tether 0.524 N", "axes are SNAME")
    text = run_page(replace(report, conditions=replace(report.conditions, assumptions=assumptions)))
    tables, conditions = text.index(">Coefficients"), text.index(">Conditions<")
    assert text.index("axes are SNAME") < tables
    assert text.index("tether 0.524 N") > conditions


def test_headings_of_a_report_skip_no_level(report: RunReport) -> None:
    levels = [int(level) for level in re.findall(r"<h([1-6])\b", run_page(report))]
    assert levels[0] == 1
    assert all(after <= before + 1 for before, after in pairwise(levels))

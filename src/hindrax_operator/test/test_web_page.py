"""The page in a real browser without a screen: it shows the vehicle, passes orders on, opens reports, fits a phone."""

import base64
import json
import math
from dataclasses import replace
from pathlib import Path

import pytest
from web_rig import ARMED, DISARMED, ESTIMATE, PLANS, TOKEN, served

from hindrax_analysis.testing.browser import browser, browser_at_hand
from hindrax_control.commissioning.findings import PROVEN, Finding, Findings
from hindrax_control.maneuver.goal import Goal
from hindrax_ident.online.aim import Aim, ExperimentGoal
from hindrax_operator.snapshot import CameraFrame, ManeuverView, NodeHealth

PROGRAM = browser_at_hand()

pytestmark = pytest.mark.skipif(
    PROGRAM is None, reason="needs a browser: chromium or google-chrome on the PATH (`apt install chromium`)"
)
SHOWN = (
    *("heading", "30.0 deg", "+0.312 m/s", "unknown", "1640 us", "lost: sway", "at 270.0 deg", "no echo"),
    *("no reading for <b>3.2 s</b>", "k_q 66.10 ±0.40", "20\u00a0Hz", "x 4.20 m, y 2.90 m ±0.20 m"),
    *("2.50 m", "disabled", "heave_down", "8.7 ±2.5 N at 0.28 m/s"),
)
"""What the page must show; what a node says is text, not markup."""
ABORTED = ManeuverView("", "aborted", "", 0.42, 93.0, 2.1, 14.2, 0.312)
"""After its end the pilot flies no motion."""
RESTING = replace(ESTIMATE, motion="heave_down", learning=False, reason="its stamp is not later than the previous one")
STOP_RED = "rgb(179, 38, 30)"
COLOR_OF_STOP = "getComputedStyle(document.getElementById('stop')).backgroundColor"
BAND_OF_NOW = """(() => {
  const canvas = document.createElement('canvas'), now = heard_ms;
  Object.assign(canvas.style, {width: '300px', height: '120px', display: 'block'});
  document.body.append(canvas);
  const points = [...Array(40).keys()].map(i => ({at: now - 40000 + 1000 * i, value: 70, band: i < 30 ? 900 : 6}));
  plot(canvas, [points], now - 40000, 1);
  const {data} = canvas.getContext('2d').getImageData(280, 0, 1, 100);
  canvas.remove();
  return [...Array(100).keys()].filter(i => data[4 * i + 3] > 30).length;
})()"""
"""Rows of 100 that the band of a settled estimate covers, after one that was a hundred times as wide."""
PICTURE = base64.b64decode(
    "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAAAAAA6fptVAAAACklEQVR4nGNoAAAAggCBd81ytgAAAABJRU5ErkJggg=="
)
"""A PNG of one pixel."""
EXPERIMENT = "most informative legs"
TOO_SMALL = """[...document.querySelectorAll('button,select,#seed,.pick,#reports a')].filter(one => one.offsetParent)
.map(one => [one.textContent, one.getBoundingClientRect()])
.filter(([_, size]) => size.width < 44 || size.height < 44)"""
"""What is smaller than 44 pixels, the least that WCAG 2.1 (success criterion 2.5.5) wants for a finger."""

ORDER = """[...document.querySelectorAll('main > section')].filter(one => one.offsetParent)
.sort((a, b) => a.offsetTop - b.offsetTop).slice(0, 3)
.map(one => one.querySelector('h2').firstChild.textContent.trim())"""
"""What a phone shows first, below STOP."""


def text(place: str) -> str:
    return f"document.getElementById('{place}').textContent"


def two_runs(folder: Path) -> Path:
    """A folder of one run with a report, and one that has only a bag."""
    runs = folder / "runs"
    (runs / "first day").mkdir(parents=True)
    (runs / "second day" / "bag").mkdir(parents=True)
    report = "<!doctype html><h1 style='color:rgb(1,2,3)'>A report</h1><script>window.ran = true</script>"
    (runs / "first day" / "report.html").write_text(report, encoding="utf-8")
    drag = "{speed: [0.28], force: [8.7], std_calibrated: [2.5]}"
    motions = f"heave_down: {{identifiable: true, drag_force: {drag}}}\n"
    (runs / "first day" / "coefficients.yaml").write_text(f"motions:\n  {motions}")
    return runs


def test_the_page_in_a_browser(tmp_path: Path) -> None:
    with served(two_runs(tmp_path)) as page, browser(str(PROGRAM), tmp_path / "profile") as seen:
        seen.look(1400, 900)
        seen.open(f"{page.url}#{TOKEN}")
        seen.wait(f"{text('armed')} === 'ARMED'")
        assert seen.run(COLOR_OF_STOP) == STOP_RED
        # The token is not left in the address.
        assert seen.run("location.href") == page.url
        seen.wait("document.querySelector('#reports table') !== null")
        shown = seen.run("document.body.innerText + document.getElementById('pool').textContent")
        for words in SHOWN:
            assert words in shown, words
        seen.wait("document.querySelector('#pool polyline') !== null")
        colored = "[...document.querySelector('canvas').getContext('2d').getImageData(0,0,200,130).data].some(v => v)"
        assert seen.run(colored)

        # What is picked is told as the pilot tells it.
        seen.wait(f"{text('planned')} === {json.dumps(PLANS['surge'])}")

        # Orders: one maneuver at a time, its outcome, an end at any time.
        seen.run("document.querySelector('[value=yaw]').click()")
        seen.run("document.getElementById('start').click()")
        seen.wait("document.getElementById('flying').disabled")
        assert page.vehicle.orders == [Goal(("surge", "yaw"), "plateaus", 1, "hold")]
        assert page.vehicle.landed is not None
        page.vehicle.landed("the maneuver ended early, by operator: cancelled", False)
        seen.wait(f"{text('outcomes')}.includes('ended early')")
        for name in ("cancel", "disarm", "stop"):
            seen.run(f"document.getElementById('{name}').click()")
            seen.wait(f"{text('outcomes')}.includes('{name}: ')")
        assert page.vehicle.orders[1:] == ["cancel", "disarm", "stop"]
        assert page.vehicle.present()

        # A vehicle that falls silent is not shown as armed.
        page.vehicle.shown = replace(ARMED, silent_s=7.0)
        seen.wait(f"{text('armed')} === 'vehicle silent'")
        assert seen.run(COLOR_OF_STOP) == STOP_RED, "who is silent may still listen"
        page.vehicle.shown = replace(ARMED, silent_s=7.0, stoppable=False)
        seen.wait(f"{text('reason')}.includes('cut the power')")
        assert seen.run(COLOR_OF_STOP) != STOP_RED, "it would be refused"
        page.vehicle.shown = replace(ARMED, silent_s=math.inf, stoppable=False)
        seen.wait(f"{text('reason')} === 'no message from the thrusters'")
        flown = ManeuverView("surge", "plateau", "", 0.42, 93.0, 2.1, 14.2, 0.312)
        page.vehicle.shown = replace(ARMED, flight=flown, estimates={"surge": ESTIMATE, "heave_down": RESTING})
        seen.wait(f"{text('flight')}.includes('42 %')")

        # Nothing is wider than a phone, in any color, and nothing is too small for a finger.
        for scheme, width in (("light", 360), ("dark", 390)):
            seen.look(width, 844, scheme)
            assert seen.run("document.documentElement.scrollWidth") <= width
            assert seen.run(
                "[...document.querySelectorAll('.scroll')].every(one => one.scrollWidth <= one.clientWidth)"
            )
            assert seen.run(TOO_SMALL) == []
            assert seen.run(ORDER) == ["Health", "Maneuver", "Estimate"]
            # While it flies, nothing can be started: the estimate is on the first screen instead.
            assert seen.run("document.getElementById('flying').offsetParent") is None
            assert seen.run("document.getElementById('estimate').getBoundingClientRect().top + scrollY") < 844
            seen.picture(tmp_path / f"phone-{scheme}.png")
        assert not seen.complaints

        assert "second day\u00a0 recorded, no report yet" in seen.run(text("reports"))
        seen.run("document.querySelector('#reports a').click()")
        seen.wait("document.querySelector('h1').textContent === 'A report'")
        assert seen.run("getComputedStyle(document.querySelector('h1')).color") == "rgb(1, 2, 3)"
        assert seen.run("window.ran") is None, "a report's script must not run with the rights of the page"


def test_what_is_wrong_is_on_the_first_screen_of_a_desk_too(tmp_path: Path) -> None:
    """It moves there at once, but back only after a while: what comes and goes must not move what is pressed."""
    bottom = "document.getElementById('nodes').getBoundingClientRect().bottom"
    well = replace(ARMED, health={f"node_{number}": NodeHealth("ok", "well", 20.0) for number in range(10)})
    wrong = replace(well, health={**well.health, "dvl75": NodeHealth("error", "no answer; check its cable")})
    with served(tmp_path, well) as page, browser(str(PROGRAM), tmp_path / "profile") as seen:
        seen.open(f"{page.url}#{TOKEN}")
        for width, height in ((1280, 800), (1024, 768)):
            seen.look(width, height)
            seen.wait(f"{text('health')}.includes('node_9')")
            seen.wait(f"{bottom} > {height}")
            page.vehicle.shown = wrong
            seen.wait(f"{text('health')}.includes('check its cable')")
            assert seen.run(bottom) < height
            seen.picture(tmp_path / f"wrong-{width}.png")
            page.vehicle.shown = well
            seen.wait(f"!{text('health')}.includes('check its cable')")
            assert seen.run(bottom) < height
            seen.run("ill_ms -= WRONG_ms")
        seen.wait(f"{bottom} > {height}")
        assert not seen.complaints


def test_a_commissioning_from_the_page_shows_what_was_found(tmp_path: Path) -> None:
    with served(tmp_path, DISARMED) as page, browser(str(PROGRAM), tmp_path / "profile") as seen:
        seen.look(390, 844)
        seen.open(f"{page.url}#{TOKEN}")
        seen.wait("!document.getElementById('commission').disabled")
        seen.run("document.getElementById('commission').click()")
        seen.wait(f"{text('proving')} === 'keep your hands off'")
        assert page.vehicle.found is not None
        assert page.vehicle.landed is not None
        page.vehicle.found(Findings((Finding("T3", PROVEN, "[0, 0, 1]", "99 % of its force"),)))
        page.vehicle.landed("everything is proven", True)
        seen.wait(f"{text('claims')}.includes('99 % of its force')")
        assert seen.run(text("yaml")).startswith("commissioned:")
        seen.wait("document.getElementById('picture').naturalWidth > 0")
        assert seen.run("document.documentElement.scrollWidth") <= 390
        assert seen.run(TOO_SMALL) == []
        seen.picture(tmp_path / "commissioned.png")
        assert not seen.complaints


def test_the_identification_node_chooses_the_legs_if_asked(tmp_path: Path) -> None:
    with served(tmp_path) as page, browser(str(PROGRAM), tmp_path / "profile") as seen:
        seen.open(f"{page.url}#{TOKEN}")
        seen.wait(f"{text('armed')} === 'ARMED'")
        seen.run(f"document.getElementById('excitation').value = {json.dumps(EXPERIMENT)}")
        seen.run("document.getElementById('excitation').dispatchEvent(new Event('change'))")
        seen.run("document.getElementById('until').value = 2; document.getElementById('minutes').value = 5")
        seen.wait(f"{text('planned')}.includes('most informative')")
        seen.run("document.getElementById('start').click()")
        seen.wait("document.getElementById('flying').disabled")
        assert page.vehicle.orders[-1] == ExperimentGoal(("surge",), Aim(0.02, 5.0), "hold")


def test_a_camera_the_estimate_over_time_and_banners_that_go(tmp_path: Path) -> None:
    with served(tmp_path) as page, browser(str(PROGRAM), tmp_path / "profile") as seen:
        seen.open(f"{page.url}#{TOKEN}")
        seen.wait(f"{text('armed')} === 'ARMED'")

        # A camera of the graph is shown as soon as it is there.
        page.vehicle.frames["/front/image"] = CameraFrame(1, PICTURE)
        page.vehicle.shown = replace(page.vehicle.shown, cameras=("/front/image",))
        seen.wait("document.getElementById('frame').naturalWidth === 1 && !document.getElementById('frame').hidden")

        # The estimate over time, with a name for who cannot see it.
        page.vehicle.shown = replace(page.vehicle.shown, estimates={"surge": replace(ESTIMATE, samples=900)})
        seen.wait("document.querySelector('#courses canvas').ariaLabel.startsWith('surge k_q over time, now 66.1')")
        assert seen.run("[...document.querySelectorAll('canvas,svg,#frame')].every(one => one.ariaLabel || one.alt)")
        assert seen.run(BAND_OF_NOW) > 40
        keys = "[...document.querySelectorAll('.scroll')].every(one => one.tabIndex === 0 && one.ariaLabel)"
        assert seen.run(keys), "what scrolls can be scrolled by keys"

        # What a banner says goes with what it says: a refusal when the vehicle is armed after all.
        page.vehicle.shown = replace(page.vehicle.shown, thrusters=DISARMED.thrusters)
        seen.wait("document.getElementById('flying').disabled")
        seen.run("order('fly', {motions: ['surge']})")
        seen.wait(f"{text('outcomes')}.includes('wanted armed')")
        page.vehicle.shown = replace(page.vehicle.shown, thrusters=ARMED.thrusters)
        seen.wait(f"!{text('outcomes')}.includes('wanted armed')")

        # Why a maneuver ended stands once: in its banner, and in its place when the banner is gone.
        assert page.vehicle.landed is None
        seen.wait("!document.getElementById('flying').disabled")
        seen.run("document.getElementById('start').click()")
        seen.wait("document.getElementById('flying').disabled")
        assert page.vehicle.landed is not None
        page.vehicle.shown = replace(page.vehicle.shown, flight=replace(ABORTED, aborted="leak: found water"))
        page.vehicle.landed("the maneuver ended early, by leak: found water", False)
        seen.wait(f"{text('flight')} === 'the maneuver ended early'")
        seen.run("document.querySelector('#outcomes button').click()")
        seen.wait(f"{text('flight')} === 'the maneuver ended by leak: found water'")


def test_without_the_token_the_page_asks_for_it_and_a_page_that_watches_has_no_buttons(tmp_path: Path) -> None:
    with served(tmp_path, read_only=True) as page, browser(str(PROGRAM), tmp_path / "profile") as seen:
        seen.open(page.url)
        seen.wait("!document.getElementById('ask').hidden")
        seen.run("document.title = 'the page before'")
        seen.open(f"{page.url}#wrong")
        seen.wait(f"document.title === 'hindrax' && {text('armed')} === 'no token'")
        # Nothing red where nothing would happen.
        assert seen.run(COLOR_OF_STOP) != STOP_RED
        seen.run(f"document.getElementById('token').value = '{page.url}#{TOKEN}'")
        seen.run("document.querySelector('#ask button').click()")
        seen.wait(f"{text('armed')} === 'ARMED'")
        for name in ("stop", "disarm", "start", "cancel"):
            assert seen.run(f"document.getElementById('{name}').offsetParent === null"), name
        assert not page.vehicle.present()

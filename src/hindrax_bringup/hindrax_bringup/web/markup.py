"""What stands on the page before anything is known."""

from __future__ import annotations

from hindrax_control.excitation import EXCITATIONS
from hindrax_control.maneuvers import PLATEAUS
from hindrax_control.plan import MOTIONS

_MOTIONS = "".join(
    f'<label class="pick"><input type="checkbox" name="motion" value="{name}"'
    f"{' checked' if name == 'surge' else ''}>{name}</label>"
    for name in MOTIONS
)
_EXCITATIONS = "".join(f"<option>{name}</option>" for name in (PLATEAUS, *EXCITATIONS))

BODY = f"""
<header>
 <span id="armed" class="pill dim" role="status">connecting</span>
 <span id="reason"></span><span id="title" class="soft"></span>
 <span class="orders"><button id="disarm" type="button">disarm</button>
 <button id="stop" type="button" class="stop">STOP</button></span>
</header>
<div id="told" aria-live="polite"></div>
<form id="ask" hidden><label for="token">The token from the address that <code>./hindrax web</code> printed</label>
<input id="token" autocomplete="off" spellcheck="false"><button>open</button></form>
<main id="view">
<section class="wide tall"><h2>Pool from above</h2><svg id="pool" role="img" aria-label="the vehicle in the pool"></svg>
<p id="where" class="soft"></p></section>
<section class="wide"><h2>Maneuver</h2><div id="flight"></div>
<form id="fly"><fieldset id="flying"><legend class="soft">fly, in this order</legend>
<div class="picks">{_MOTIONS}</div>
<label>with <select id="excitation">{_EXCITATIONS}</select></label>
<label>seed <input id="seed" type="number" min="0" max="4294967295" value="1"></label>
<label>then <select id="ending"><option>hold</option><option>neutral</option></select></label>
<button id="start">start</button></fieldset>
<button id="cancel" type="button">cancel the maneuver</button></form><p id="why" class="soft"></p></section>
<section><h2>State</h2><dl id="state"></dl></section>
<section><h2>Thrusters <small id="lost" class="bad"></small></h2><div id="thrusters"></div></section>
<section class="wide"><h2>Last two minutes</h2><div class="plots">
<figure><figcaption>speed [m/s] <i class="a">surge</i> <i class="b">sway</i> <i class="c">heave</i></figcaption>
<canvas data-keys="surge sway heave" data-span="0.1"></canvas></figure>
<figure><figcaption>from surface and bottom [m] <i class="a">depth</i> <i class="b">altitude</i></figcaption>
<canvas data-keys="depth altitude" data-span="0.2"></canvas></figure>
<figure><figcaption>attitude [deg] <i class="a">roll</i> <i class="b">pitch</i></figcaption>
<canvas data-keys="roll pitch" data-span="4"></canvas></figure>
<figure><figcaption>heading [deg] <i class="a">heading</i></figcaption>
<canvas data-keys="heading" data-span="10"></canvas></figure></div></section>
<section class="wide"><h2>Estimate, with 95 % bands</h2>
<div class="scroll"><table id="estimates"></table></div></section>
<section><h2>Holds</h2><dl id="holds"></dl></section>
<section><h2>Health</h2><ul id="health"></ul></section>
<section class="wide"><h2>Finished reports</h2><ul id="reports"></ul></section>
</main>
"""

"""The looks of the page: the colors of a report, light and dark as set; one column on a phone, three on a desk."""

from __future__ import annotations

CSS = """
:root{color-scheme:light dark;--ground:#fbfbfa;--card:#fff;--ink:#1c2530;--soft:#5b6775;--rule:#dfe3e8;--grid:#e9ecef;
--accent:#0b6e8a;--good:#1a7f4b;--bad:#b3372f;--warn:#8a6208;--a:#0b6e8a;--b:#cc3d55;--c:#7a55b5;--water:#e3f1f5}
@media(prefers-color-scheme:dark){:root{--ground:#12171d;--card:#1a212a;--ink:#e8edf2;--soft:#9dabb9;--rule:#303a46;
--grid:#29323d;--accent:#5fc3df;--good:#5ccb8f;--bad:#ff8d84;--warn:#e6b450;--a:#5fc3df;--b:#ff7a8c;--c:#b99af0;
--water:#15303a}}
*{box-sizing:border-box}[hidden]{display:none!important}
body{margin:0;background:var(--ground);color:var(--ink);font:16px/1.45 system-ui,-apple-system,"Segoe UI",Roboto,
"DejaVu Sans",sans-serif;font-variant-numeric:tabular-nums;-webkit-text-size-adjust:100%}
header{position:sticky;top:0;z-index:2;display:flex;flex-wrap:wrap;align-items:center;gap:6px 12px;padding:8px 16px;
background:var(--card);border-bottom:3px solid var(--accent)}
.pill{border-radius:99px;padding:3px 14px;font-weight:700;border:2px solid currentColor}
.pill.armed{background:var(--bad);border-color:var(--bad);color:var(--card)}.pill.safe{color:var(--good)}
.pill.warn{color:var(--warn)}.pill.dim{color:var(--soft)}
.soft{color:var(--soft)}.good{color:var(--good)}.bad{color:var(--bad)}.warn{color:var(--warn)}
.orders{margin-left:auto;display:flex;gap:8px}
button,select,input{font:inherit;color:inherit;background:var(--card);border:1px solid var(--soft);border-radius:8px;
padding:6px 12px;min-height:40px}button{cursor:pointer}button:disabled{opacity:.45;cursor:default}
button.stop{background:#b3261e;border-color:#b3261e;color:#fff;font-weight:700;padding:6px 26px}
:focus-visible{outline:3px solid var(--accent);outline-offset:2px}
#told p{margin:0;padding:6px 16px;border-bottom:1px solid var(--rule);background:var(--card)}
#told p::before{font-weight:700;content:"done  "}#told p.bad::before{content:"not done  "}
#ask{padding:24px 16px;display:grid;gap:10px;max-width:460px}
main{display:grid;grid-template-columns:repeat(4,minmax(0,1fr));gap:12px;max-width:1500px;margin:0 auto;
padding:12px 16px}
main.old{opacity:.45}
section{background:var(--card);border:1px solid var(--rule);border-radius:10px;padding:10px 14px;min-width:0}
section.wide{grid-column:span 2}section.tall{grid-row:span 2}
h2{font-size:1rem;margin:0 0 8px}h2 small{font-weight:400}p{margin:6px 0}
dl{display:grid;grid-template-columns:max-content minmax(0,1fr);gap:2px 14px;margin:0}dt{color:var(--soft)}
dd{margin:0;overflow-wrap:anywhere}
ul{margin:0;padding:0;list-style:none}li{overflow-wrap:anywhere;padding:1px 0}a{color:var(--accent)}
#pool{display:block;width:100%;max-height:520px}.water{fill:var(--water);stroke:var(--soft);stroke-width:.06}
.trace{fill:none;stroke:var(--a);stroke-width:.05;stroke-linejoin:round}.meter{stroke:var(--rule);stroke-width:.02}
.hull{fill:var(--ink)}.bow{fill:var(--b)}
.thruster{display:grid;grid-template-columns:1.8em 1fr 4.5em 4.4em;gap:8px;align-items:center}
.thruster b+span{position:relative;height:12px;background:var(--grid);border-radius:3px;overflow:hidden}
.thruster i{position:absolute;top:0;bottom:0;background:var(--a)}.thruster.full i{background:var(--bad)}
.thruster span:nth-child(n+3){text-align:right;white-space:nowrap}
.bar{height:12px;border-radius:6px;background:var(--grid);overflow:hidden;margin:4px 0}
.bar i{display:block;height:100%;background:var(--accent)}
fieldset{border:0;margin:8px 0;padding:0;display:flex;flex-wrap:wrap;gap:8px 12px;align-items:center}
legend{padding:0}.picks{display:flex;flex-wrap:wrap;gap:6px;flex-basis:100%}
.pick{display:inline-flex;gap:6px;align-items:center;border:1px solid var(--rule);border-radius:8px;padding:0 10px;
min-height:40px}.pick input{min-height:0}#seed{width:7em}
.plots{display:grid;grid-template-columns:1fr 1fr;gap:10px}figure{margin:0;min-width:0}
figcaption{font-size:.85rem;color:var(--soft)}figcaption i{font-style:normal;font-weight:600}
i.a{color:var(--a)}i.b{color:var(--b)}i.c{color:var(--c)}canvas{display:block;width:100%;height:132px}
.scroll{overflow-x:auto}table{border-collapse:collapse;width:100%;font-size:.92rem}
th,td{padding:3px 8px;white-space:nowrap;border-bottom:1px solid var(--rule)}
th,td,.coefficient{text-align:left}td.many{white-space:normal}.coefficient{display:inline-block;white-space:nowrap;
margin-right:18px}th{color:var(--soft);font-weight:600}
@media(max-width:1100px){main{grid-template-columns:1fr 1fr}}
@media(max-width:640px){main{grid-template-columns:minmax(0,1fr);padding:8px}section.wide{grid-column:auto}section.tall{grid-row:auto}
header{padding:8px}#title{flex-basis:100%;order:9;font-size:.85rem}.plots{grid-template-columns:1fr}
#estimates{font-size:.86rem}
#estimates :is(th,td):nth-child(3){display:none}#estimates :is(th,td){padding:3px 4px}.coefficient{margin-right:4px}}
"""

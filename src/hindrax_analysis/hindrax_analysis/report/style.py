"""Style of a report: one column on a phone, two on a desktop, black on white on paper; light and dark by preference."""

from __future__ import annotations

CSS = """
:root{color-scheme:light dark;--ground:#fbfbfa;--card:#fff;--ink:#1c2530;--soft:#5b6775;--rule:#dfe3e8;--grid:#e9ecef;
--accent:#0b6e8a;--good:#1a7f4b;--bad:#b3372f;--measured:#557a9e;--model:#cc3d55;--online:#2c8a57;--plateau:#b07d12;
--truth:#1c2530;--paper:#7a55b5;--prior:#008b9a;--earlier:#8a94a0;--limit:#8a94a0}
@media(prefers-color-scheme:dark){:root{--ground:#12171d;--card:#1a212a;--ink:#e8edf2;--soft:#9dabb9;--rule:#303a46;
--grid:#29323d;--accent:#5fc3df;--good:#5ccb8f;--bad:#ff8d84;--measured:#8db4da;--model:#ff7a8c;--online:#63cf94;
--plateau:#e6b450;--truth:#f4f7fa;--paper:#b99af0;--prior:#4fd0dd;--earlier:#8794a2;--limit:#8794a2}}
*{box-sizing:border-box}
body{margin:0;background:var(--ground);color:var(--ink);font:16px/1.5 system-ui,-apple-system,"Segoe UI",Roboto,
"DejaVu Sans",sans-serif;font-variant-numeric:tabular-nums;-webkit-text-size-adjust:100%}
main{max-width:1120px;margin:0 auto;padding:24px 16px 64px}
header{border-bottom:3px solid var(--accent);padding-bottom:14px;margin-bottom:20px}
h1{font-size:1.75rem;line-height:1.2;margin:0 0 4px}h2{font-size:1.35rem;margin:40px 0 10px;padding-top:10px;
border-top:1px solid var(--rule)}h3{font-size:1.05rem;margin:26px 0 8px}h4{font-size:.95rem;margin:0 0 6px}
p{margin:6px 0 10px;max-width:76ch}.soft{color:var(--soft)}a{color:var(--accent)}
.chips{display:flex;flex-wrap:wrap;gap:8px;margin:12px 0 0;padding:0}
.chip{border:1px solid currentColor;border-radius:99px;padding:1px 11px;font-size:.86rem}
.chip.good{color:var(--good)}.chip.bad{color:var(--bad)}.chip.mock{color:var(--plateau);font-weight:600}
.headline{display:grid;grid-template-columns:repeat(auto-fit,minmax(160px,1fr));gap:12px;margin:14px 0}
.headline div{background:var(--card);border:1px solid var(--rule);border-radius:10px;padding:10px 14px}
.headline b{display:block;font-size:1.5rem;line-height:1.25}.headline small{color:var(--soft);display:block}
.scroll{overflow-x:auto;margin:8px 0 6px;border:1px solid var(--rule);border-radius:10px;background:var(--card)}
table{border-collapse:collapse;width:100%;font-size:.9rem}
th,td{padding:6px 12px;text-align:right;white-space:nowrap;border-bottom:1px solid var(--rule)}
tr:last-child td{border-bottom:0}th{color:var(--soft);font-weight:600;font-size:.82rem}
td.left,th.left{text-align:left}td small{color:var(--soft);display:block;line-height:1.3}
tr.own td{font-weight:600}tr.own small{font-weight:400}.head{display:none}
.plots{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(100%,430px),1fr));gap:16px;margin:12px 0}
figure{margin:0;padding:14px 14px 10px;background:var(--card);border:1px solid var(--rule);border-radius:10px;
min-width:0;break-inside:avoid}
figure.wide{grid-column:1/-1}figcaption{font-size:.86rem;color:var(--soft);margin-top:6px}
svg{display:block;width:100%;height:auto;overflow:visible}svg svg{overflow:hidden}
svg text{fill:var(--soft);font-size:12.5px}svg text.label,svg text.name{fill:var(--ink);font-size:13px}
.grid{stroke:var(--grid)}.zero{stroke:var(--earlier)}
.line{fill:none;stroke:currentColor;stroke-width:2;stroke-linejoin:round}.dashed{stroke-dasharray:6 4}
.band{fill:currentColor;fill-opacity:.30;stroke:none}.band.faint{fill-opacity:.14}
.dots{fill:none;stroke:currentColor;stroke-linecap:round}.stem{fill:none;stroke:currentColor;stroke-width:2.5}
.bars rect{fill:currentColor;fill-opacity:.75}
.whisker{fill:none;stroke:currentColor}.whisker.outer{stroke-width:2;stroke-opacity:.55}.whisker.inner{stroke-width:6;
stroke-opacity:.45}
.measured{color:var(--measured)}.model{color:var(--model)}.online{color:var(--online)}.plateau{color:var(--plateau)}
.truth{color:var(--truth)}.paper{color:var(--paper)}.prior{color:var(--prior)}.earlier{color:var(--earlier)}
.limit{color:var(--limit)}
.legend{display:flex;flex-wrap:wrap;gap:3px 16px;margin:6px 0 0;font-size:.84rem}
.legend span{display:inline-flex;align-items:center;gap:6px}
.key{display:inline-block;width:20px;height:0;border-top:2px solid currentColor}.key.line{stroke:none}
.key.dashed{border-top-style:dashed}.key.band,.key.bars{height:11px;border:0;background:currentColor;opacity:.34}
.key.band.faint{opacity:.16}.key.points{width:8px;height:8px;border:0;border-radius:9px;background:currentColor}
.warning{border-left:4px solid var(--bad);background:var(--card);padding:8px 14px;border-radius:0 10px 10px 0;
margin:12px 0}
.warning ul{margin:4px 0;padding-left:20px}details{margin:14px 0}summary{cursor:pointer;color:var(--accent)}
dl{display:grid;grid-template-columns:max-content 1fr;gap:4px 18px;font-size:.9rem;margin:8px 0}dt{color:var(--soft)}
dd{margin:0;overflow-wrap:anywhere}
@media(max-width:720px){.scroll th:first-child,.scroll td:first-child{position:sticky;left:0;background:var(--card);
box-shadow:1px 0 var(--rule);white-space:normal;min-width:7em}}
@media(max-width:520px){main{padding:16px 12px 48px}h1{font-size:1.4rem}figure{padding:10px 8px 8px}
thead{display:none}tr{display:grid;grid-template-columns:1fr 1fr;gap:4px 14px;padding:8px 12px;
border-bottom:1px solid var(--rule)}tr:last-child{border-bottom:0}
.scroll td,.scroll td:first-child{display:block;padding:0;border:0;text-align:left;white-space:normal;position:static;
box-shadow:none;overflow-wrap:anywhere}.scroll td:first-child{grid-column:1/-1}.scroll td:empty{display:none}
.head{display:block;color:var(--soft);font-size:.8rem;font-weight:400}
svg text{font-size:14px}svg text.label,svg text.name{font-size:14.5px}
dl{grid-template-columns:1fr}dt{margin-top:6px}}
@media print{:root{color-scheme:light;--ground:#fff;--card:#fff;--ink:#000;--soft:#444;--rule:#bbb;--grid:#ddd;
--accent:#0b6e8a;--good:#1a7f4b;--bad:#b3372f;--measured:#557a9e;--model:#cc3d55;--online:#2c8a57;--plateau:#b07d12;
--truth:#000;--paper:#7a55b5;--prior:#008b9a;--earlier:#777;--limit:#777}
body{font-size:10.5pt;print-color-adjust:exact;-webkit-print-color-adjust:exact}main{max-width:none;padding:0}
.plots{grid-template-columns:1fr 1fr;gap:8px}h2,h3,h2+p,h2+.soft{break-after:avoid}.scroll{overflow:visible}
th,td{padding:3px 6px}}
@page{margin:14mm}
"""

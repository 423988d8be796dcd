"""HTML and style sheet of reports."""

from __future__ import annotations

from string import Template

# Body of a calibration report.
BODY = Template("""<header>
$mark<div class="verdict"><b>$verdict</b><br>$reason</div>
<h1>Calibration report $number</h1>
<p>Heavy/soft impact source: $source</p>
</header>
<table class="columns"><tr>
<td><table class="pairs">$about</table></td>
<td><table class="pairs">$measured</table></td>
</tr></table>
<table class="cards criteria">
<thead><tr>$head</tr></thead>
<tbody>
<tr><th colspan="10">$level</th></tr>
$rows
</tbody>
</table>
<p class="rule">$rule</p>
<table class="columns figures"><tr>
$figures
</tr></table>
<h2>Uncertainty budgets</h2>
<table class="cards budget scroll" tabindex="0">
<thead><tr>$budget_head</tr></thead>
$budgets
</table>
<p class="rule">$budget_rule</p>
<table class="columns"><tr>
<td>$drops$properties</td>
<td>$processing$warnings</td>
</tr></table>
<h2 class="keep">Files and their SHA-256</h2>
<table class="files">$files</table>
<div class="end">
<p class="statement">$statement</p>
<table class="signature"><tr>$signature</tr></table>
<footer>$footer</footer>
</div>
""")

# The page around the body of any report, which may have further styles. On screens narrower than a
# table, each of its rows becomes a card; long tables of numbers scroll inside the page.
PAGE = Template("""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>$title</title>
<style>
@page { size: A4; margin: 10mm 12mm 14mm;
  @bottom-left { content: "$identity"; font: 6.5pt '$family'; color: #444; width: 140mm; }
  @bottom-right { content: "page " counter(page) " of " counter(pages);
    font: 6.5pt '$family'; color: #444; }
}
:root { color-scheme: light; }
html { font: 13px/1.4 '$family', Verdana, sans-serif; color: #000; background: #fff; }
body { margin: 0 auto; font-variant-ligatures: none; overflow-wrap: anywhere; }
sub { line-height: 0; font-size: 0.8em; vertical-align: -0.2em; }
h1 { font-size: 2em; line-height: 1.2; margin: 0 0 0.2em; }
h2 { font-size: 1em; margin: 0.8em 0 0.2em; break-after: avoid; }
header { border-bottom: 2px solid #000; padding-bottom: 0.6em; margin-bottom: 0.8em;
  display: flow-root; }
header p { margin: 0; font-size: 1.2em; }
.mark { float: left; max-width: 9em; max-height: 6em; margin-right: 1.2em; }
.verdict { float: right; width: 55%; box-sizing: border-box; padding: 0.3em 0.8em;
  border: 2px solid #000; text-align: center; margin-left: 1em; }
.verdict b { font-size: 1.5em; text-transform: uppercase; }
table { border-collapse: collapse; width: 100%; font-variant-numeric: tabular-nums; }
td, th { padding: 0; vertical-align: top; text-align: left; }
.columns, .pairs { table-layout: fixed; }
.columns > tbody > tr > td + td { padding-left: 0.8em; }
.columns > tbody > tr > td:first-child { padding-right: 0.8em; }
.pairs th { width: 9em; font-weight: normal; color: #444; }
.cards { margin-top: 0.8em; border-bottom: 1px solid #000; }
.cards th, .cards td { text-align: right; padding: 0.2em 0 0.2em 0.6em; white-space: nowrap; }
.cards thead th { border-top: 1px solid #000; border-bottom: 1px solid #000; }
.criteria tbody th { font-weight: normal; }
.criteria tbody tr + tr td { border-top: 1px solid #bbb; }
.cards th:first-child, .cards td:first-child { text-align: left; padding-left: 0; }
.criteria th:last-child, .criteria td:last-child { text-align: left; }
.does-not-conform td:last-child { font-weight: bold; }
.undecided td:last-child { text-decoration: underline; }
.budget tbody { break-inside: avoid; border-top: 1px solid #bbb; }
.budget th[colspan] { text-align: left; padding-left: 0; white-space: normal; }
.budget td { padding-top: 0; padding-bottom: 0; }
.budget td:first-child { padding-left: 1em; }
.range { width: 11em; height: 1.2em; display: block; margin: 0 auto; }
.rule { margin: 0.3em 0 0.6em; }
.figure { display: block; width: 100%; margin: 0 auto; }
li, tr { break-inside: avoid; }
.columns > tbody > tr { break-inside: auto; }
ul { margin: 0; padding: 0 0 0 1em; list-style: '–  '; }
.files td:last-child { text-align: right; }
/* The signature is on a page with the last files, and with the last notes if they are few. */
.keep, .end, .files tr:nth-last-child(-n+6) { break-before: avoid; }
.end { break-inside: avoid; }
.statement { margin: 0.8em 0 0; }
.signature { margin-top: 2em; table-layout: fixed; }
.signature td { padding-right: 1.5em; vertical-align: bottom; }
.signature span { display: block; border-top: 1px solid #000; padding-top: 0.2em; }
footer { margin-top: 0.8em; color: #444; font-size: 0.85em; }
@media print {
  html { font: 7.3pt/3.4mm '$family', Verdana, sans-serif; }
  body { width: 186mm; }
  .range { width: 20mm; height: 3.4mm; }
  .cards, .files { table-layout: fixed; }
  .cards th, .cards td { padding-left: 1.1mm; }
  .criteria th { width: 16mm; }
  .criteria th:first-child { width: 24mm; }
  .criteria th:nth-child(2) { width: 17mm; }
  .criteria th:nth-child(3) { width: 16mm; }
  .criteria th:nth-child(4) { width: 19mm; }
  .criteria th:nth-child(5), .criteria th:nth-child(7) { width: 10.5mm; }
  .criteria th:nth-last-child(2) { width: 20mm; }
  .criteria th:last-child { width: 26.5mm; }
  .budget th { width: 20mm; }
  .budget th:first-child { width: 38mm; }
  .budget th:nth-child(2), .budget th:nth-child(4) { width: 12mm; }
  .budget th:nth-child(7), .budget th:last-child { width: 27mm; }
  .files td:last-child { width: 104mm; }
  .figures { height: 64mm; }
  .figure { width: 80mm; height: 64mm; }
  .signature { margin-top: 9mm; }
}
@media screen {
  body { max-width: 74em; padding: 1.5em 1em; }
  .figure { max-width: 32em; }
}
@media screen and (max-width: 60em) {
  html { font-size: 14px; }
  .verdict { float: none; width: auto; margin: 0 0 0.8em; }
  .mark { float: none; display: block; margin-bottom: 0.8em; }
  .columns > tbody > tr > td { display: block; padding: 0 !important; }
  .figure { margin-bottom: 1em; }
  .scroll { display: block; overflow-x: auto; }
  .scroll :is(th, td) { overflow-wrap: normal; }
  .scroll :is(th, td):first-child { position: sticky; left: 0; background: #fff; }
  .scroll th[colspan] span { display: inline-block; max-width: calc(100vw - 3em); position: sticky;
    left: 0; }
  .cards:where(:not(.scroll)) thead { display: none; }
  .cards:where(:not(.scroll)) tr { display: grid; padding: 0.4em 0;
    grid-template-columns: repeat(auto-fill, minmax(6.5em, 1fr)); border-top: 1px solid #bbb; }
  .cards:where(:not(.scroll)) :is(td, th) { padding: 0 !important; border: 0 !important;
    text-align: left; white-space: normal; }
  .cards:where(:not(.scroll)) :is(td:first-child, th) { grid-column: 1 / -1; font-weight: bold; }
  .cards:where(:not(.scroll)) td:not(:first-child)::before { content: attr(data-label);
    display: block; color: #444; font-weight: normal; font-size: 0.85em; }
  .range { width: 95%; margin: 1em 0 0; }
  .files td, .signature td { display: block; text-align: left !important; }
  .signature td { padding: 1.5em 0 0; }
}
$style</style>
</head>
<body>
$body
</body>
</html>
""")

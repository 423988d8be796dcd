"""HTML and style sheet of a calibration report."""

from __future__ import annotations

from string import Template

# Body of the page.
BODY = Template("""<header>
<div class="verdict"><b>$verdict</b><br>$reason</div>
<h1>Calibration report</h1>
<p>Heavy/soft impact source: $source</p>
</header>
<table class="columns"><tr>
<td><table class="pairs">$about</table></td>
<td><table class="pairs">$measured</table></td>
</tr></table>
<table class="criteria">
<thead><tr>$head</tr></thead>
<tbody>
$rows
</tbody>
</table>
<p class="rule">$rule</p>
<table class="columns figures"><tr>
$figures
</tr></table>
<table class="columns"><tr>
<td>$drops</td>
<td>$processing$warnings</td>
</tr></table>
<h2>Files and their SHA-256</h2>
<table class="files">$files</table>
<table class="signature"><tr>
<td>Place and date</td><td>Name</td><td>Signature</td>
</tr></table>
<footer>$footer</footer>
""")

# The page around the body.
PAGE = Template("""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>$title</title>
<style>
$fonts
@page { size: A4; margin: 9mm 12mm 8mm; }
:root { color-scheme: light; }
html { font: 7.3pt/3.4mm '$family', sans-serif; color: #000; background: #fff; }
body { width: 186mm; margin: 0 auto; font-variant-ligatures: none; overflow-wrap: anywhere; }
@media screen { body { padding: 11mm 12mm; } }
h1 { font-size: 15pt; line-height: 6mm; margin: 0 0 1mm; }
h2 { font-size: 7.3pt; line-height: 3.4mm; margin: 2mm 0 0.6mm; }
header { border-bottom: 0.4mm solid #000; padding-bottom: 1.5mm; margin-bottom: 2mm;
  display: flow-root; }
header p { margin: 0; font-size: 9pt; line-height: 4mm; }
.verdict { float: right; width: 118mm; min-height: 12.6mm; box-sizing: border-box;
  padding: 0.8mm 2mm; border: 0.5mm solid #000; text-align: center; font-size: 0.93em;
  line-height: 2.9mm; }
.verdict b { font-size: 11pt; line-height: 4.4mm; text-transform: uppercase; }
table { border-collapse: collapse; width: 100%; font-variant-numeric: tabular-nums; }
td, th { padding: 0; vertical-align: top; text-align: left; }
.columns { table-layout: fixed; }
.columns > tbody > tr > td + td { padding-left: 2mm; }
.columns > tbody > tr > td:first-child { padding-right: 2mm; }
.pairs { table-layout: fixed; }
.pairs th { width: 23mm; font-weight: normal; color: #444; }
.criteria { margin-top: 2mm; border-bottom: 0.3mm solid #000; }
.criteria th, .criteria td { text-align: right; padding: 0.5mm 0 0.5mm 2mm; white-space: nowrap; }
.criteria th { border-top: 0.3mm solid #000; border-bottom: 0.2mm solid #000; }
.criteria tbody tr + tr td { border-top: 0.1mm solid #bbb; }
.criteria th:first-child, .criteria td:first-child { text-align: left; padding-left: 0; }
.criteria th:last-child, .criteria td:last-child { text-align: left; width: 29mm; }
.does-not-conform td:last-child { font-weight: bold; }
.inconclusive td:last-child { text-decoration: underline; }
.range { width: 34mm; height: 3.4mm; display: block; margin: 0 auto; }
.rule { margin: 0.8mm 0 1.2mm; }
.figures { height: 64mm; }
.figure { display: block; width: 91mm; height: 64mm; }
li, tr { break-inside: avoid; }
ul { margin: 0; padding: 0 0 0 3mm; list-style: '–  '; }
.files { table-layout: auto; }
.files td:last-child { text-align: right; white-space: nowrap; }
.signature { margin: 11mm -4mm 0; width: 194mm; table-layout: fixed; border-spacing: 4mm 0;
  border-collapse: separate; }
.signature td { border-top: 0.2mm solid #000; padding-top: 0.5mm; }
footer { margin-top: 2mm; color: #444; font-size: 6pt; }
</style>
</head>
<body>
$body
</body>
</html>
""")

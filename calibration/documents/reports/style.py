"""The style of all reports, on a screen and on A4."""

from calibration.documents.reports.markup import css_string

STYLE = """
:root { --ink: #1b2126; --soft: #56606a; --rule: #c9d0d6; --pale: #f2f4f6; --accent: #1f5a8c; --bad: #a3251b; }
* { box-sizing: border-box; }
html { font: 10.5px/1.5 "Noto Sans", "DejaVu Sans", "Segoe UI", system-ui, "Noto Sans CJK SC", sans-serif; }
body { color: var(--ink); background: #fff; max-width: 178mm; margin: 12mm auto; padding: 0 4mm; }
header { border-bottom: 2px solid var(--ink); padding-bottom: 8px; margin-bottom: 14px; }
h1 { font-size: 21px; line-height: 1.2; margin: 0; letter-spacing: -0.2px; }
header p { margin: 4px 0 0; color: var(--soft); }
h2 { font-size: 12.5px; margin: 20px 0 7px; padding-bottom: 3px; border-bottom: 1px solid var(--rule);
  break-after: avoid; }
h2 .nr { color: var(--accent); display: inline-block; min-width: 18px; }
p { margin: 0 0 6px; }
p.small, figcaption { color: var(--soft); font-size: 9px; }
table { border-collapse: collapse; width: 100%; font-variant-numeric: tabular-nums; margin: 0 0 7px; }
tr { break-inside: avoid; }
th { font-weight: 600; color: var(--soft); text-align: right; padding: 2px 0 3px 10px; vertical-align: bottom; }
td { text-align: right; padding: 2.5px 0 2.5px 10px; border-top: 1px solid var(--pale); vertical-align: top; }
th:first-child, td:first-child, .words th, .words td { text-align: left; }
th:first-child, td:first-child { padding-left: 0; }
table.facts th { width: 26mm; text-align: left; vertical-align: top; font-weight: 400; padding: 2px 0; }
table.facts td { text-align: left; border: 0; padding: 2px 0; overflow-wrap: anywhere; }
.verdict { border: 1.5px solid var(--ink); border-left-width: 7px; padding: 9px 13px; margin: 0 0 4px;
  break-inside: avoid; }
.verdict p { margin: 0; }
.verdict .word { font-size: 15px; font-weight: 700; }
.verdict.no { border-color: var(--bad); }
.verdict.no .word { color: var(--bad); }
.blank { display: inline-block; min-width: 34mm; border-bottom: 1px dotted var(--soft); color: var(--soft);
  font-size: 8.5px; }
.columns { display: flex; gap: 9mm; align-items: flex-start; }
.columns > * { flex: 1 1 0; min-width: 0; }
figure { margin: 8px 0; break-inside: avoid; }
figure img { max-width: 100%; max-height: 82mm; width: auto; height: auto; display: block;
  border: 1px solid var(--rule); }
svg { width: 100%; height: auto; display: block; }
table.findings th { width: 18mm; text-align: left; color: var(--ink); vertical-align: top; padding: 3px 0; }
table.findings td { text-align: left; padding: 3px 0; }
table.findings .error { color: var(--bad); }
table.findings .fix { color: var(--soft); }
.signatures { display: flex; gap: 14mm; margin-top: 17mm; break-inside: avoid; }
.signatures div { flex: 1; border-top: 1px solid var(--ink); padding-top: 3px; color: var(--soft); font-size: 9px; }
.end { margin-top: 7mm; color: var(--soft); font-size: 9px; text-align: center; }
code { font-family: "Noto Sans Mono", "DejaVu Sans Mono", monospace; font-size: 8.5px; overflow-wrap: anywhere; }
@media print { body { max-width: none; margin: 0; padding: 0; } }
"""


def page_style(footer: str) -> str:
    """STYLE, and margins of A4 with `footer` and the number of the page on every page."""
    box = "font: 8px 'Noto Sans', 'DejaVu Sans', sans-serif; color: #56606a;"
    return (
        f"{STYLE}@page {{ size: A4; margin: 17mm 16mm 18mm;"
        f" @bottom-left {{ content: {css_string(footer)}; {box} }}"
        f' @bottom-right {{ content: "page " counter(page) " of " counter(pages); {box} }} }}\n'
    )

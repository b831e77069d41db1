"""Style sheet of the page."""

STYLE = """
:root { color-scheme: light dark;
  --paper: #fff; --ink: #1c2024; --soft-ink: #555d66; --line: #d5dade; --head: #f2f4f6;
  --good: #1f8f4e; --bad: #cf3b2e; --soft: #8a7a1f; }
@media (prefers-color-scheme: dark) { :root {
  --paper: #15181b; --ink: #e6e9ec; --soft-ink: #a2abb4; --line: #363c42; --head: #1f2429;
  --good: #3fbf77; --bad: #f0685a; --soft: #c9b548; } }
* { box-sizing: border-box; }
body { margin: 0; background: var(--paper); color: var(--ink);
  font: 15px/1.45 system-ui, sans-serif; }
main { max-width: 1500px; margin: 0 auto; padding: 1.5rem; }
h1 { font-size: 1.6rem; margin: 0 0 .5rem; }
h2 { font-size: 1.15rem; margin: 2.2rem 0 .2rem; }
p { margin: .2rem 0 .7rem; color: var(--soft-ink); max-width: 75ch; }
dl { display: flex; flex-wrap: wrap; gap: .2rem 1.5rem; margin: 0; }
dt { color: var(--soft-ink); } dt::after { content: ":"; }
dd { margin: 0 0 0 -1.1rem; font-weight: 600; }
.scroll { overflow: auto; max-height: 85vh; border: 1px solid var(--line); border-radius: 6px; }
table { border-collapse: separate; border-spacing: 0; font-variant-numeric: tabular-nums;
  width: 100%; }
th, td { padding: .25rem .6rem; border-bottom: 1px solid var(--line); text-align: right;
  white-space: nowrap; font-weight: 400; }
tr:last-child > * { border-bottom: 0; }
th[scope=row] { text-align: left; position: sticky; left: 0; background: var(--paper);
  border-right: 1px solid var(--line); }
thead th { position: sticky; top: 0; background: var(--head); font-weight: 600; z-index: 1;
  white-space: normal;
  vertical-align: bottom; }
thead th:first-child { left: 0; z-index: 2; text-align: left; }
td.text { text-align: left; white-space: normal; min-width: 30ch; }
th[scope=row].text { white-space: normal; min-width: 26ch; }
td.good { background: color-mix(in srgb, var(--good) var(--part), transparent); }
td.bad { background: color-mix(in srgb, var(--bad) var(--part), transparent); }
td.soft { background: color-mix(in srgb, var(--soft) var(--part), transparent); }
.matrix { width: auto; }
.matrix thead th:nth-child(n+3) span { writing-mode: vertical-rl; transform: rotate(180deg); }
.matrix thead th:nth-child(n+3) { padding: .4rem .2rem; text-align: center; }
.matrix td { text-align: center; min-width: 2.2rem; padding: .2rem; }
"""

"""One page for a scene, a plan, a run, an execution while it happens, and a folder of runs; and static pieces for notebooks.

`timeline` computes the timeline of a run and `ground` the map; `data` gathers all that the page shows as one JSON object
(docs/page.md). `page.html`, `page.css` and the parts of `script/` show that object: `frozen` embeds it in a file,
`confab.serving` serves it, `widget` passes it to a notebook. `sheet` plans after changes on the page, `live` follows an
execution. `pieces` and `markup` are HTML without a script, for the values that a notebook shows.
"""

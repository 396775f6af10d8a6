"""The HTML page that shows a scene, a plan, a run, a running execution or a folder of runs, and static HTML for notebooks.

The module `timeline` computes the timeline of a run, and the module `ground` computes the background of the map. The module
`data` collects the content of the page as one JSON object (docs/page.md). The files `page.html`, `page.css` and `script/` display
the JSON object. The module `frozen` embeds the page and the object in a file, `confab.serving` serves the page, and `widget`
shows the page in a notebook. The module `sheet` plans again after a user has changed a control on the page, and `live` follows a
running execution. The modules `pieces` and `markup` make HTML without a script.
"""

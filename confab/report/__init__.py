"""The report of a run as one HTML file, and its pieces, which notebooks show, too.

`course` computes the timeline of a run; `pieces` turns timelines, plans and explanations into HTML; `page` assembles the pieces.
The page's template, style and script are `page.html`, `style.css` and `script.js`.
"""

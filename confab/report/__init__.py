"""The report of a run as one HTML file, and its pieces, which notebooks show, too.

`course` says what was when; `pieces` turns that, plans and explanations into HTML; `page` puts the pieces together. What the
browser needs lies beside them: `page.html`, `style.css`, `script.js`.
"""

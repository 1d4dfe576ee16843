"""A certificate per device: one A4 page from its result documents.

`collect.certificate` gathers the contents, `render` writes HTML and Markdown, and `pdf` prints the
page with a browser where there is one.
"""

"""Pages: facts in sections, with a renderer for text and one for HTML; `to_plain` makes JSON of
them.

html     the page in a browser: one file with its pictures, its style and a small script that enlarges them
section  facts, tables and pictures in sections
text     the page on a screen: rows of facts, columns of tables
"""

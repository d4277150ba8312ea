"""Pages: facts in sections, and a renderer each for text and HTML. As JSON they are what `to_plain` makes of a value.

html     the page in a browser: one file with its pictures, its style and a small script that enlarges them
section  facts, tables and pictures in sections
text     the page on a screen: rows of facts, columns of tables
"""

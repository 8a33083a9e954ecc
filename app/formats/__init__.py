"""
Survey tools' files into drives: pure parsing, no store, no network.

`sniff` finds a file's format by its content, one module a format turns it into blocks of neutral
`rows`, `assemble` makes those into drives, and an `account` says what became of every row.
`docs/formats.md` tells what is read of each format.
"""

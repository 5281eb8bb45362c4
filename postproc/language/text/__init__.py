"""Texts of programs: bytes, lines, shapes of lines, numbers and edits of them."""

"""Follow a program in any language: control flow, calls, and what is known where."""

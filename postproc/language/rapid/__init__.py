"""RAPID, the language of ABB controllers: its text, read without losing a byte."""

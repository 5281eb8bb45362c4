"""Commands run twice, the second time with every message scrambled.

Nothing decides by the text of a message: with other texts the statuses, codes and exit
codes are the same.
"""

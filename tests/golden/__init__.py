"""What the command line writes, kept: a changed byte is seen.

A case is a few commands run one after the other in a folder of their own. What they
print and write is recorded, with times, versions and paths masked, and compared:

    make golden BASE=<commit>          all cases, and their cost, here and at a commit
    python -m tests.golden cost COMMIT  processor time and memory alone
    python -m tests.golden check       a quick set against manifest.json
    python -m tests.golden update      write manifest.json again

What a rename changes stands in translation.toml: the other commit is run in its own
words, and what it writes is compared in those of this version.

Only the command line is used, and all inputs are kept: inputs.zip holds programs (the
cases and the corpus of the tests, generated and damaged ones, a tree), models fitted
once, and surveys. So the same cases run on a package whose modules lie elsewhere.
"""

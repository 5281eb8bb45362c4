"""All that a worker needs for its first program, loaded before workers are forked."""

from postproc.language.languages import languages

for _language in languages():
    _language.prepare()

"""Validates outputs of `tactus --json`: `validate.py SCHEMAS OUTPUTS`, a schema's name and an object on each line."""

import json
import pathlib
import sys

import jsonschema

schemas, count = pathlib.Path(sys.argv[1]), 0
for line in open(sys.argv[2]):
    name, text = line.split(" ", 1)
    schema = json.loads((schemas / f"{name}.json").read_text())
    validator = jsonschema.Draft202012Validator(schema)
    value = json.loads(text)
    validator.validate(value)
    # A schema that takes anything proves nothing: every field is one that it names.
    # One of several shapes has its properties one level below; the validation above has told which it is.
    if "properties" in schema:
        assert set(value) <= set(schema["properties"]), (name, set(value))
    assert not validator.is_valid({}), name
    count += 1
print(count, "outputs are valid")

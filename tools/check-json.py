#!/usr/bin/env python3
"""Compares what commands print with --json with the schemas of docs/schemas: check-json.py PROGRAMS RUNS [SCHEMAS]

PROGRAMS is the folder of the programs, RUNS a table such as tools/json.txt, SCHEMAS a folder (docs/schemas). Needs the PyPI package
jsonschema. Found are: a command without the option, without a schema or without a run; a schema that is none, that admits unknown keys, or
that describes a property without its unit; output that is not one object (map-live: one a line), or not as its schema says; a
property that no run prints. Runs whose library is not there are left out, and said.
"""
import json
import os
import re
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor

import jsonschema

# The commands whose lines are checked, and those of which --json is no option.
EXTRA = {"map-live"}
UNIT = re.compile(r"no unit|(^|[ ,(])(m|m²|m rad|rad|rad²|degrees|degrees²|s|ns|1/s|px|nats|bytes|units)([ ,;:)]|$)")
faults = []


def fault(text):
    faults.append(text)


def commands(programs):
    """Names of all commands, as their schemas are named, and whether each has --json."""
    table = subprocess.run(
        ["sh", "tools/option-tables.sh", programs], capture_output=True, text=True, check=True
    ).stdout
    found, name, parents = {}, None, set()
    for row in table.splitlines():
        kind, _, rest = row.partition("\t")
        first = rest.partition("\t")[0]
        if kind == "program":
            name = first.removeprefix("cairn ").replace(" ", "-")
            found[name] = False
        elif kind == "option" and first == "--json":
            found[name] = True
        elif kind == "command":
            parents.add(name)
    return {name: has for name, has in found.items() if name not in parents}


def walk(schema, where):
    """The properties of a schema as (path, schema), after looking at each object and property."""
    kinds = schema.get("type", [])
    kinds = [kinds] if isinstance(kinds, str) else kinds
    if "object" in kinds:
        if schema.get("additionalProperties") is not False:
            fault(f"{where}: unknown keys are admitted, expected \"additionalProperties\": false")
        if "required" not in schema:
            fault(f"{where}: no \"required\"")
        for name, inner in schema.get("properties", {}).items():
            path = f"{where}/{name}"
            described = inner.get("description", "")
            if not described:
                fault(f"{path}: no description")
            elif "object" not in str(inner.get("type")) and not UNIT.search(described):
                fault(f"{path}: '{described}', expected its unit, or 'no unit'")
            yield path
            yield from walk(inner, path)
    if "items" in schema:
        yield from walk(schema["items"], where)


def printed(value, where):
    """The paths of all properties in a value."""
    if isinstance(value, dict):
        for name, inner in value.items():
            yield f"{where}/{name}"
            yield from printed(inner, f"{where}/{name}")
    elif isinstance(value, list):
        for inner in value:
            yield from printed(inner, where)


def no_repeats(pairs):
    """An object; a name that stands twice is refused."""
    names = [name for name, _ in pairs]
    if len(names) != len(set(names)):
        raise ValueError(f"a name stands twice: {names}")
    return dict(pairs)


def objects(name, text):
    """What a run printed."""
    texts = text.splitlines() if name in EXTRA else [text]
    values = [json.loads(t, object_pairs_hook=no_repeats, parse_constant=float_name) for t in texts]
    if not values or not all(isinstance(value, dict) for value in values):
        raise ValueError("no object")
    return values


def float_name(text):
    raise ValueError(f"{text} is no number of JSON")


def run(programs, folder, name, command):
    """Runs a command; the paths that it prints."""
    environment = dict(os.environ, PATH=f"{os.path.abspath(programs)}:{os.environ['PATH']}", LC_ALL="C")
    done = subprocess.run(
        command.replace("@", folder), shell=True, capture_output=True, text=True, check=False,
        env=environment, stdin=subprocess.DEVNULL,
    )
    if done.returncode != 0:
        return command, f"exit code {done.returncode}: {done.stderr.strip()}", []
    try:
        return command, None, objects(name, done.stdout)
    except ValueError as error:
        return command, f"{error}: {done.stdout[:100]!r}", []


def read_runs(path, programs):
    runs, left_out = [], []
    needed = None
    with open(path, encoding="utf-8") as file:
        for line in file:
            if not line.strip() or line.startswith("#"):
                continue
            if line.startswith("needs "):
                needed = line.split()[1]
                continue
            name, _, command = line.partition("|")
            is_there = needed is None or os.path.exists(os.path.join(programs, needed))
            (runs if is_there else left_out).append((name.strip(), command.strip()))
            needed = None
    return runs, left_out


def read_schemas(folder):
    schemas = {}
    for file in sorted(os.listdir(folder)):
        path = os.path.join(folder, file)
        with open(path, encoding="utf-8") as opened:
            schema = json.load(opened, object_pairs_hook=no_repeats)
        if schema.get("$schema") != "https://json-schema.org/draft/2020-12/schema":
            fault(f"{path}: not of draft 2020-12")
        jsonschema.Draft202012Validator.check_schema(schema)
        schemas[file.removesuffix(".json")] = schema
    return schemas


def main():
    programs, table = sys.argv[1], sys.argv[2]
    folder = sys.argv[3] if len(sys.argv) > 3 else "docs/schemas"
    schemas, (runs, left_out) = read_schemas(folder), read_runs(table, programs)
    known = commands(programs)
    for name, has_option in known.items():
        if not has_option:
            fault(f"{name}: no option --json")
        if name not in schemas:
            fault(f"{name}: no schema {folder}/{name}.json")
        if name not in {run_name for run_name, _ in runs + left_out}:
            fault(f"{name}: no run in {table}")
    for name in schemas:
        if name not in known and name not in EXTRA:
            fault(f"{folder}/{name}.json: no such command")
    seen = set()
    with tempfile.TemporaryDirectory() as work, ThreadPoolExecutor(2) as pool:
        results = pool.map(lambda r: (r[0], *run(programs, work, *r)), runs)
        for name, command, error, values in results:
            if error is not None:
                fault(f"{command}: {error}")
            for value in values if name in schemas else []:
                best = jsonschema.exceptions.best_match(
                    jsonschema.Draft202012Validator(schemas[name]).iter_errors(value)
                )
                if best is not None:
                    fault(f"{command}: {best.json_path}: {best.message[:200]}")
                    break
                seen.update(printed(value, name))
    skipped = {name for name, _ in left_out} - {name for name, _ in runs}
    for name, schema in schemas.items():
        for path in walk(schema, name):
            if path not in seen and name not in skipped:
                fault(f"{path}: in {folder}, but no run prints it")
    for name in sorted(skipped):
        print(f"skipped --json of {name}: its library is not built")
    for text in faults:
        print(f"FAILED json: {text}")
    if not faults:
        print(f"ok     --json: {len(runs)} runs print what {len(schemas)} schemas say")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())

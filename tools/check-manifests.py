#!/usr/bin/env python3
"""Checks the manifests of other build systems: python3 tools/check-manifests.py [ROOT]

Each has the keys that its tool requires, none that it does not know, values of the right kind, and the version of
include/cairn/version.h; the files that it names exist. The tools themselves load from registries and are not run. Only the
standard library is needed; the YAML read is the part that the manifests use.
"""
import json
import os
import re
import sys

root = sys.argv[1] if len(sys.argv) > 1 else "."
faults = []


def fault(path, text):
    faults.append(f"{path}: {text}")


def read(path):
    try:
        with open(os.path.join(root, path), encoding="utf-8") as file:
            return file.read()
    except OSError as error:
        fault(path, f"{error.strerror}, expected a manifest")
        return ""


def scalar(text):
    text = text.strip()
    return text[1:-1] if len(text) > 1 and text[0] == text[-1] and text[0] in "\"'" else text


def yaml(path):
    """Nested mappings by indentation, with texts and lists of texts as values."""
    top = {}
    stack = [(-1, top, None)]
    for number, line in enumerate(read(path).splitlines(), 1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        indent = len(line) - len(line.lstrip())
        while indent <= stack[-1][0]:
            stack.pop()
        holder, key = stack[-1][1], stack[-1][2]
        if line.lstrip().startswith("- "):
            if holder[key] == {}:
                holder[key] = []
            holder[key].append(scalar(line.lstrip()[2:]))
            continue
        match = re.match(r"([\w-]+):(.*)$", line.strip())
        if not match:
            fault(f"{path}:{number}", f"'{line.strip()}', expected 'key: value' or '- value'")
            continue
        if key is not None:
            holder = holder[key]
        holder[match[1]] = scalar(match[2]) if match[2].strip() else {}
        stack.append((indent, holder, match[1]))
    return top


def properties(path):
    return dict(line.split("=", 1) for line in read(path).splitlines() if "=" in line)


def parsed_json(path):
    try:
        return json.loads(read(path) or "{}")
    except ValueError as error:
        fault(path, f"{error}, expected JSON")
        return {}


# A schema: key -> (required, kind); a kind is a type, a pattern of a text, or the schema of a mapping.
VERSION = r"\d+\.\d+\.\d+"
TEXT = r".+"
PLATFORMIO = {
    "name": (True, r"[A-Za-z0-9_.+ -]{1,50}"),
    "version": (True, VERSION),
    "description": (True, r".{1,255}"),
    "keywords": (True, list),
    "license": (True, TEXT),
    "authors": (False, list),
    "homepage": (False, TEXT),
    "repository": (False, dict),
    "headers": (False, list),
    "frameworks": (False, TEXT),
    "platforms": (False, TEXT),
    "export": (False, {"include": (False, list), "exclude": (False, list)}),
    "build": (False, {"includeDir": (False, TEXT), "srcDir": (False, TEXT), "srcFilter": (False, list), "flags": (False, list)}),
}
ARDUINO = {
    "name": (True, r"[A-Za-z0-9][A-Za-z0-9 _.-]{0,62}"),
    "version": (True, VERSION),
    "author": (True, TEXT),
    "maintainer": (True, TEXT),
    "sentence": (True, TEXT),
    "paragraph": (True, r".*"),
    "category": (True, "Display|Communication|Signal Input/Output|Sensors|Device Control|Timing|Data Storage|Data Processing|Other"),
    "url": (True, r".*"),
    "architectures": (True, TEXT),
    "includes": (False, TEXT),
    "depends": (False, TEXT),
    "dot_a_linkage": (False, "true|false"),
}
ESP_IDF = {
    "version": (True, VERSION),
    "description": (False, TEXT),
    "url": (False, TEXT),
    "license": (False, TEXT),
    "dependencies": (False, {"idf": (True, r"[<>=~^]+\d+\.\d+.*")}),
    "files": (False, {"include": (False, list), "exclude": (False, list)}),
}
ZEPHYR = {
    "name": (True, r"[a-z0-9_-]+"),
    "build": (True, {"cmake": (True, TEXT), "kconfig": (False, TEXT)}),
}
VCPKG = {
    "name": (True, r"[a-z0-9]+(-[a-z0-9]+)*"),
    "version": (True, VERSION),
    "description": (False, TEXT),
    "homepage": (False, TEXT),
    "license": (False, TEXT),
    "supports": (False, TEXT),
    "dependencies": (False, list),
}


def check(path, found, schema, place=""):
    for key, (required, _) in schema.items():
        if required and key not in found:
            fault(path, f"no key '{place}{key}'")
    for key, value in found.items():
        if key not in schema:
            fault(path, f"key '{place}{key}', expected one of {', '.join(schema)}")
            continue
        kind = schema[key][1]
        if isinstance(kind, dict):
            if isinstance(value, dict):
                check(path, value, kind, f"{place}{key}.")
            else:
                fault(path, f"'{place}{key}' is no mapping")
        elif isinstance(kind, str):
            if not isinstance(value, str) or not re.fullmatch(kind, value):
                fault(path, f"'{place}{key}' is {value!r}, expected {kind}")
        elif not isinstance(value, kind):
            fault(path, f"'{place}{key}' is {value!r}, expected a {kind.__name__}")


def exists(path, names, folder=""):
    for name in names:
        if not os.path.exists(os.path.join(root, folder, name)):
            fault(path, f"'{name}' is not there")


def main():
    version = re.search(r'VERSION_STRING "(.*)"', read("include/cairn/version.h"))
    version = version[1] if version else "?"
    manifests = {
        "library.json": (parsed_json, PLATFORMIO),
        "packaging/arduino/library.properties": (properties, ARDUINO),
        "idf_component.yml": (yaml, ESP_IDF),
        "zephyr/module.yml": (yaml, ZEPHYR),
        "packaging/vcpkg/cairn/vcpkg.json": (parsed_json, VCPKG),
    }
    found = {}
    for path, (reader, schema) in manifests.items():
        found[path] = reader(path)
        check(path, found[path], schema)
        if "version" in schema and found[path].get("version", version) != version:
            fault(path, f"version {found[path]['version']}, expected that of include/cairn/version.h, {version}")
    package = "python/ros/package.xml"
    stated = re.search(r"<version>(.*)</version>", read(package))
    if not stated or stated[1] != version:
        fault(package, f"version {stated[1] if stated else 'missing'}, expected that of include/cairn/version.h, {version}")
    library = found["library.json"]
    exists("library.json", library.get("headers", []), "include")
    exists("library.json", [library.get("build", {}).get(key, ".") for key in ("includeDir", "srcDir")])
    exists("library.json", [name for key in ("include", "exclude") for name in library.get("export", {}).get(key, [])])
    exists("zephyr/module.yml", ["CMakeLists.txt"], found["zephyr/module.yml"].get("build", {}).get("cmake", "."))
    exists("zephyr/module.yml", [found["zephyr/module.yml"].get("build", {}).get("kconfig", ".")])
    exists("vcpkg.json", ["portfile.cmake"], "packaging/vcpkg/cairn")
    for text in faults:
        print(text)
    if not faults:
        print(f"ok     manifests: {len(manifests) + 1} of version {version}")
    return 1 if faults else 0


sys.exit(main())

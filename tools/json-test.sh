#!/bin/sh
# Whether tools/check-json.py finds what is wrong in schemas and output: tools/json-test.sh PROGRAMS PYTHON
programs=${1:?usage: tools/json-test.sh PROGRAMS PYTHON}
python=${2:?usage: tools/json-test.sh PROGRAMS PYTHON}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
failed=0
cp -r docs/schemas "$work/schemas"

# planted SCHEMA SCRIPT RUN TEXT: the schema is changed by sed, and this run of its command must be refused with TEXT
planted()
{
    if [ -n "$2" ]; then
        sed "$2" "docs/schemas/$1.json" >"$work/schemas/$1.json"
        ! cmp -s "docs/schemas/$1.json" "$work/schemas/$1.json" || echo "FAILED json: '$2' changes nothing in $1.json" >>"$work/unchanged"
    fi
    [ -z "$3" ] || echo "$1 | $3" >>"$work/runs.txt"
    printf '%s\n' "$4" >>"$work/expected"
}
graph='cairn graph data/graphs/apartment.g2o --json'
planted info 's/"damaged"/"harmed"/' 'cairn info data/logs/apartment.log --json' "'damaged' was unexpected"
planted graph '/^    "solver",*$/d; s/"solver": {/"resolver": {/' "$graph" "'solver' was unexpected"
planted graph '' '' 'graph/resolver: in '
planted model 's/"type": "array"/"type": "object"/' 'cairn model data/shapes/mug.shape -o @/mug.shape --json' 'is not of type'
planted match 's/"additionalProperties": false/"additionalProperties": true/' 'cairn match data/logs/none.log data/logs/none.log' 'match: unknown keys are admitted'
planted match '' '' 'exit code 2'
planted merge 's/"required"/"wanted"/' 'echo [1]' 'merge: no "required"'
planted merge '' '' 'no object'
planted align 's/description": "standard deviation of the poses in the log, m"/description": "spread"/' 'echo "{\"scans\": NaN}"' "align/spread_m: 'spread', expected its unit"
planted align '' '' 'NaN is no number of JSON'
planted train 's/"description": "images; no unit",*/"title": "images"/; s/"title": "images"$/&,/' 'echo "{\"images\": 1, \"images\": 1}"' 'train/images: no description'
planted train '' '' 'a name stands twice'
planted replay 's/2020-12/2019-09/' '' 'replay.json: not of draft 2020-12'
planted replay '' '' 'replay: no run in'
planted map-live '' 'echo "{\"scan\":0}"' "'stamp_ns' is a required property"
planted detect '' 'cairn info data/logs/apartment.log' 'Expecting value'
mv "$work/schemas/skeleton.json" "$work/schemas/skelton.json"
planted skeleton '' '' 'skeleton: no schema'
planted skelton '' '' 'skelton.json: no such command'
"$python" tools/check-json.py "$programs" "$work/runs.txt" "$work/schemas" >"$work/said" 2>&1 && failed=1
while IFS= read -r text; do
    grep -qF "$text" "$work/said" || {
        echo "FAILED json: expected '$text'"
        failed=1
    }
done <"$work/expected"
[ ! -f "$work/unchanged" ] || {
    cat "$work/unchanged"
    failed=1
}
[ $failed -eq 0 ] || sed 's/^/    /' "$work/said"
exit $failed

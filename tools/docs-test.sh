#!/bin/sh
# Tests that the API reference rejects what is not documented, or not so: tools/docs-test.sh BUILD, where tools/docs.sh has run
build=${1:?usage: tools/docs-test.sh BUILD}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
failed=0

# expect MESSAGE STATUS TEXT: the message that must be printed, with a failure
expect()
{
    if [ "$2" -eq 0 ] || ! echo "$3" | grep -q "$1"; then
        echo "FAILED API reference test: expected \"$1\" with a failure, got exit $2: $3"
        failed=1
    fi
}

# spoil MESSAGE HEADER SCRIPT: the message when a header is changed by a sed script
spoil()
{
    rm -rf "$work/include"
    cp -r include "$work/include"
    sed -i "$3" "$work/include/cairn/$2"
    if cmp -s "include/cairn/$2" "$work/include/cairn/$2"; then
        echo "FAILED API reference test: \"$3\" changes nothing in $2"
        failed=1
    fi
    said=$(sh tools/docs.sh "$work/build" "$work/include/cairn" 2>&1)
    expect "$1" $? "$said"
}

spoil "parameter 'block_bytes'" pool.h '/^ \* block_bytes: /d'
spoil 'cairn_icp_params.cell_size: the comment is' icp.h 's/> 1\/CAIRN_REAL_MAX (0\.2): side of/> 0: side of/'
spoil 'cairn_icp_mode: no comment' icp.h '/^\/\* Distance of a pair/d'
spoil 'CAIRN_ICP_CONVERGED = 1,: no comment' icp.h '/converged_distance and converged_angle \*\//d'
spoil 'cairn_icp_target_count: no comment' icp.h '/^\/\* Returns the number of target points/d'
spoil 'cairn_icp_no_such: no public name' icp.h 's/Returns the number of target points/Returns cairn_icp_no_such/'

mkdir "$work/defaults"
sed '/cairn_icp_params/s/\t0\.2\t/\t0.3\t/' "$build/docs/params.tsv" >"$work/defaults/params.tsv"
said=$(sh tools/docs-defaults.sh "$build" "$work/defaults" 2>&1)
expect 'cairn_icp_params.cell_size: the comment says 0.3, the default is 0.2' $? "$said"

sed '/cairn_icp_params/s/\t1 \.\.\. 2^24\t/\t1 ... 2^25\t/' "$build/docs/params.tsv" >"$work/defaults/params.tsv"
said=$(sh tools/docs-defaults.sh "$build" "$work/defaults" 2>&1)
expect 'cairn_icp_params.max_target: the comment says <= 33554432, the table <= 16777216' $? "$said"

sed '/cairn_icp_params/s/\t>= 0, < 1\t/\t>= 0, <= 1\t/' "$build/docs/params.tsv" >"$work/defaults/params.tsv"
said=$(sh tools/docs-defaults.sh "$build" "$work/defaults" 2>&1)
expect 'cairn_icp_params.weak_ratio: the comment says <= 1, the table < 1' $? "$said"

sed '/cairn_icp_params/s/\t>= 4\t/\tfour\t/' "$build/docs/params.tsv" >"$work/defaults/params.tsv"
said=$(sh tools/docs-defaults.sh "$build" "$work/defaults" 2>&1)
expect 'cairn_icp_params.min_pairs: the range "four" is none of those of CONTRIBUTING.md' $? "$said"

if [ -f "$build/libcairn-host.a" ]; then
    sed '/cairn_vision_canny_params/s/\t0 \.\.\. 50\t/\t0 ... 60\t/' "$build/docs/params.tsv" >"$work/defaults/params.tsv"
    said=$(sh tools/docs-defaults.sh "$build" "$work/defaults" 2>&1)
    expect 'cairn_vision_canny_params.sigma: the comment says <= 60, the table <= 50' $? "$said"
fi

[ $failed -eq 0 ] && echo "ok     API reference test"
exit $failed

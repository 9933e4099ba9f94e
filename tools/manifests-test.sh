#!/bin/sh
# Whether tools/check-manifests.py finds what is wrong in manifests: tools/manifests-test.sh
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
failed=0

# planted FILE SCRIPT TEXT: the manifests with FILE changed by sed are refused with TEXT
planted()
{
    rm -rf "$work/root" && mkdir "$work/root" && cp -r include library.json idf_component.yml LICENSE packaging zephyr "$work/root" &&
        mkdir -p "$work/root/src/host" "$work/root/python/ros" && cp python/ros/package.xml "$work/root/python/ros" && sed "$2" "$1" >"$work/root/$1"
    if python3 tools/check-manifests.py "$work/root" >"$work/said" || ! grep -q "^$3" "$work/said"; then
        echo "FAILED manifests: $1 with $2: expected '$3', found: $(cat "$work/said")"
        failed=1
    fi
}
planted library.json 's/"version": "[0-9.]*"/"version": "9.9.9"/' 'library.json: version 9.9.9'
planted library.json 's/"license"/"licence"/' "library.json: no key 'license'"
planted library.json 's/"srcFilter": \(\[.*\]\)/"srcFilter": 1/' "library.json: 'build.srcFilter' is 1"
planted library.json 's/mapper.h/maper.h/' "library.json: 'cairn/maper.h' is not there"
planted packaging/arduino/library.properties '/^version/d' "packaging/arduino/library.properties: no key 'version'"
planted packaging/arduino/library.properties 's/^category=.*/category=Robots/' "packaging/arduino/library.properties: 'category' is 'Robots'"
planted idf_component.yml 's/^version.*/version: "1"/' "idf_component.yml: 'version' is '1'"
planted zephyr/module.yml 's/cmake: zephyr/cmake: zefir/' "zephyr/module.yml: 'CMakeLists.txt' is not there"
planted packaging/vcpkg/cairn/vcpkg.json 's/"supports"/"support"/' "packaging/vcpkg/cairn/vcpkg.json: key 'support'"
planted python/ros/package.xml 's/<version>.*</<version>9.9.9</' 'python/ros/package.xml: version 9.9.9'
[ $failed -eq 0 ] && python3 tools/check-manifests.py

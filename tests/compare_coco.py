"""Reads a COCO file and the masks beside it by pycocotools (PyPI): compare_coco.py COCO.json MASKS

Every annotation must be the mask of its object (intersection over union at least 0.95, or the same pixels when it is run-length
encoded), have its area, and its box around it. Prints "N annotations"; what differs is an error.
"""
import json
import os
import struct
import sys
import zlib

import numpy as np
from pycocotools.coco import COCO


def read_png(path):
    """The grey levels of a PNG of 8 bits."""
    data = open(path, "rb").read()
    at, pixels = 8, b""
    while at < len(data):
        length, kind = struct.unpack(">I4s", data[at : at + 8])
        body = data[at + 8 : at + 8 + length]
        if kind == b"IHDR":
            width, height = struct.unpack(">II", body[:8])
        elif kind == b"IDAT":
            pixels += body
        at += 12 + length
    data, image, above = zlib.decompress(pixels), [], [0] * (width + 1)
    for y in range(height):
        kind, *line = data[y * (width + 1) : (y + 1) * (width + 1)]
        row = [0]
        for x, value in enumerate(line):
            left, up, corner = row[x], above[x + 1], above[x]
            if kind == 4:
                guess = left + up - corner
                left = min((left, up, corner), key=lambda v: abs(guess - v))
            elif kind != 1:
                left = (0, 0, up, (left + up) // 2)[kind]
            row.append((value + left) & 255)
        image.append(row[1:])
        above = row
    return np.array(image, np.uint8)


def main(path, masks):
    coco = COCO(path)
    found = coco.loadRes([dict(a) for a in json.load(open(path))["annotations"]])
    assert len(found.anns) == len(coco.anns)
    for image in coco.imgs.values():
        stem = os.path.splitext(image["file_name"])[0]
        annotations = coco.imgToAnns[image["id"]]
        scores = [a["score"] for a in annotations]
        assert scores == sorted(scores, reverse=True), scores
        for k, annotation in enumerate(annotations, 1):
            mask = read_png(f"{masks}/{stem}-mask-{k}.png") > 0
            read = coco.annToMask(annotation) > 0
            assert mask.shape == (image["height"], image["width"]) == read.shape
            union = (mask | read).sum()
            overlap = (mask & read).sum() / union if union else 1
            exact = isinstance(annotation["segmentation"], dict)
            assert overlap == 1 if exact else overlap >= 0.95, (stem, k, overlap)
            assert annotation["area"] == mask.sum(), (stem, k)
    print(f"{len(coco.anns)} annotations")


main(*sys.argv[1:])

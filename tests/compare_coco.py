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
    lines = np.frombuffer(zlib.decompress(pixels), np.uint8).reshape(height, width + 1)
    image = np.zeros((height + 1, width + 1), int)
    for y in range(height):
        kind = lines[y, 0]
        for x in range(width):
            left, up, corner = image[y + 1, x], image[y, x + 1], image[y, x]
            guess = left + up - corner
            near = min((abs(guess - v), k) for k, v in enumerate((left, up, corner)))[1]
            predicted = (0, left, up, (left + up) // 2, (left, up, corner)[near])[kind]
            image[y + 1, x + 1] = (int(lines[y, x + 1]) + predicted) & 255
    return image[1:, 1:]


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

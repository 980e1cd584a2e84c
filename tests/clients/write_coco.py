"""Writes the masks of a miniature scene as outlines in COCO's JSON.

    write_coco.py MASKS FILE STEM...

MASKS has SAM's masks STEM.json of the photographs STEM.png, 96 x 72 pixels. They are the entities of
the label images, in the order of their ids.
"""

import json
import sys

masks, file, *stems = sys.argv[1:]
coco = {"images": [], "annotations": [], "categories": [{"id": i, "name": str(i)} for i in (1, 2, 3)]}
for stem in stems:
    coco["images"].append({"id": stem, "file_name": stem + ".png", "width": 96, "height": 72})
    with open(f"{masks}/{stem}.json") as given:
        for label, mask in enumerate(json.load(given), start=1):
            coco["annotations"].append({"image_id": stem, "category_id": label,
                                        "segmentation": mask["segmentation"]})
with open(file, "w") as written:
    json.dump(coco, written)

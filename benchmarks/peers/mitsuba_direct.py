"""Mitsuba 3's `direct` integrator on a scene handed over as JSON; run by `benchmarks.accuracy.render_against_mitsuba`.

A request names the `samples` a pixel, the rows of the `lights` that shine and a `target` (.npy, or null) for the
picture; the answer is the `seconds` it took.
"""

import json
import sys
import time

import mitsuba as mi
import numpy as np
from serve import serve

mi.set_variant("llvm_ad_rgb")


def vector(values):
    return mi.ScalarPoint3f(*values)


def load(description, shining):
    camera = description["camera"]
    lights = [description["lights"][row] for row in shining]
    shapes = {
        f"shape{i}": {
            "type": "ply",
            "filename": path,
            "bsdf": {
                "type": "twosided",
                "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": description["albedo"]}},
            },
        }
        for i, path in enumerate(description["meshes"])
    }
    emitters = {
        f"light{i}": {
            "type": "point",
            "position": light["position"],
            "intensity": {"type": "rgb", "value": light["intensity"]},
        }
        for i, light in enumerate(lights)
    }
    return mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "direct", "emitter_samples": len(lights), "bsdf_samples": 0, "hide_emitters": True},
            "sensor": {
                "type": "perspective",
                "fov": camera["field_of_view"],
                "fov_axis": "y",
                "to_world": mi.ScalarTransform4f().look_at(
                    vector(camera["position"]), vector(camera["target"]), vector(camera["up"])
                ),
                "film": {
                    "type": "hdrfilm",
                    "width": description["width"],
                    "height": description["height"],
                    "rfilter": {"type": "box"},
                    "sample_border": False,
                },
                "sampler": {"type": "independent"},
            },
            **shapes,
            **emitters,
        }
    )


def main():
    with open(sys.argv[1]) as file:
        description = json.load(file)
    scenes = {}

    def answer(request):
        shining = tuple(request["lights"])
        if shining not in scenes:
            scenes[shining] = load(description, shining)
        start = time.perf_counter()
        image = np.array(mi.render(scenes[shining], spp=request["samples"]))
        seconds = time.perf_counter() - start
        if request["target"]:
            np.save(request["target"], image)
        return {"seconds": seconds}

    serve({"version": mi.__version__}, answer)


if __name__ == "__main__":
    main()

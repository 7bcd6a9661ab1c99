"""Mitsuba 3's `direct` integrator on a scene handed over as JSON; run by `benchmarks.render_against_mitsuba`.

Reads one command a line: `render SPP LIGHT|all TARGET.npy`, answers with the seconds it took.
"""

import json
import sys
import time

import mitsuba as mi
import numpy as np

mi.set_variant("llvm_ad_rgb")


def vector(values):
    return mi.ScalarPoint3f(*values)


def load(description, light):
    camera = description["camera"]
    lights = description["lights"] if light == "all" else [description["lights"][int(light)]]
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
            "integrator": {
                "type": "direct",
                "emitter_samples": len(lights),
                "bsdf_samples": 0,
                "hide_emitters": True,
            },
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
    print("ready", mi.__version__, flush=True)
    for line in sys.stdin:
        _, spp, light, target = line.split()
        if light not in scenes:
            scenes[light] = load(description, light)
        start = time.perf_counter()
        image = np.array(mi.render(scenes[light], spp=int(spp)))
        seconds = time.perf_counter() - start
        if target != "-":
            np.save(target, image)
        print(seconds, flush=True)


if __name__ == "__main__":
    main()

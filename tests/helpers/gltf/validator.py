"""Khronos' glTF validator, where `make viewers` has installed it and there is Node."""

import json
import shutil
import subprocess

from benchmarks.pictures.browser import PACKAGES

SCRIPT = """
import fs from "fs";
import validator from "gltf-validator";
const found = {};
for (const file of process.argv.slice(1)) {
  const report = await validator.validateBytes(new Uint8Array(fs.readFileSync(file)), { maxIssues: 100 });
  found[file] = report.issues.messages.filter((issue) => issue.severity < 2);
}
console.log(JSON.stringify(found));
"""


def missing():
    """What is not installed, in words, or None."""
    if not (PACKAGES / "gltf-validator").is_dir():
        return "glTF's validator is not installed: make viewers"
    return None if shutil.which("node") else "node is not installed"


def issues(*files):
    """Errors (severity 0) and warnings (1) of each file: lists of objects with `code`, `message`, `pointer`."""
    command = ["node", "--input-type=module", "-e", SCRIPT, *map(str, files)]
    done = subprocess.run(command, cwd=PACKAGES.parent, capture_output=True, text=True, check=True)
    found = json.loads(done.stdout)
    return [found[str(file)] for file in files]


def errors(*files):
    """The errors alone, of each file a list of texts."""
    return [
        [f"{issue['code']} {issue['pointer']}: {issue['message']}" for issue in each if issue["severity"] == 0]
        for each in issues(*files)
    ]

# obscurance with its kernels, for any processor from x86-64-v3 on:
#   docker build -t obscurance .
#   docker run --rm -v "$PWD:/data" --user "$(id -u)" obscurance          # the demo, into ./demo
#   docker run --rm -v "$PWD:/data" --user "$(id -u)" obscurance bake demo/temple.ply -o temple.glb
FROM python:3.14-slim AS build
RUN apt-get update && apt-get install --yes --no-install-recommends gcc libc6-dev
WORKDIR /source
COPY pyproject.toml setup.py README.md LICENSE cli.py ./
COPY obscurance obscurance
COPY raytrace raytrace
COPY ao ao
COPY scenes scenes
RUN python -m pip wheel --no-cache-dir --no-deps --wheel-dir /wheels .

FROM python:3.14-slim
RUN --mount=type=bind,from=build,source=/wheels,target=/wheels \
    python -m pip install --no-cache-dir "$(echo /wheels/*.whl)[unwrap,formats]" \
 && useradd --create-home obscurance
USER obscurance
WORKDIR /data
ENTRYPOINT ["obscurance"]
CMD ["demo", "--output", "demo"]

# obscurance with its kernels compiled:
#   docker build -t obscurance .
#   docker run --rm -v "$PWD:/work" obscurance                           # the demo, into ./demo
#   docker run --rm -v "$PWD:/work" obscurance bake demo/temple.ply -o temple.glb
# Kernels are compiled for the processor that builds the image; on another kind the first run compiles them anew.
FROM python:3.11-slim

WORKDIR /source
COPY pyproject.toml README.md LICENSE cli.py ./
COPY obscurance obscurance
COPY raytrace raytrace
COPY ao ao
COPY scenes scenes
RUN python -m pip install --no-cache-dir '.[unwrap]'

WORKDIR /work
ENV NUMBA_CACHE_DIR=/opt/kernels
RUN obscurance demo --output /tmp/demo --quiet \
 && obscurance bake /tmp/demo/temple.ply -o /tmp/w.npy --tolerance 0.05 --quiet \
 && obscurance bake /tmp/demo/temple.ply -o /tmp/w.npy --method surface --samples 16 --quiet \
 && obscurance bake /tmp/demo/temple.ply -o /tmp/w.png --uv unwrap --size 256 --samples 16 --quiet \
 && rm -r /tmp/demo /tmp/w.npy /tmp/w.png \
 && chmod -R a+rX,go-w /opt/kernels

ENTRYPOINT ["obscurance"]
CMD ["demo", "--output", "demo"]

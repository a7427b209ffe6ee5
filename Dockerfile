# A container with Monochord's page, of a simulated sensor: docker build -t monochord . && docker run -p 8420:8420 monochord
# Open the link that it prints, with localhost in place of the address. `make release-check` runs these steps without Docker.
FROM debian:bookworm-slim
RUN apt-get update \
    && apt-get install --yes --no-install-recommends python3 python3-venv libportaudio2 \
    && rm -rf /var/lib/apt/lists/*
COPY pyproject.toml constraints.txt README.md LICENSE CHANGELOG.md CITATION.cff /build/
COPY src /build/src
RUN python3 -m venv /opt/monochord \
    && /opt/monochord/bin/pip install --no-cache-dir --constraint /build/constraints.txt /build \
    && rm -rf /build
RUN useradd --create-home monochord
ENV PATH=/opt/monochord/bin:/usr/local/bin:/usr/bin:/bin
ENV NUMBA_CACHE_DIR=/home/monochord/kernels
USER monochord
WORKDIR /home/monochord
RUN monochord doctor --compile
EXPOSE 8420
ENTRYPOINT ["monochord"]
CMD ["live", "demo", "--source", "twin", "--sink", "web=0.0.0.0:8420"]

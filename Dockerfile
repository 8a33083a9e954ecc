# syntax=docker/dockerfile:1
# The commands are the Makefile's own: what runs here is what runs on a developer's machine.

FROM python:3.11-slim-bookworm AS build
SHELL ["/bin/bash", "-o", "pipefail", "-c"]
# hadolint ignore=DL3008
RUN apt-get update \
    && apt-get install -y --no-install-recommends gcc libc6-dev make \
    && rm -rf /var/lib/apt/lists/*
WORKDIR /opt/roadprint
# The dependencies and the C half alone first: this layer outlives changes of the Python code.
COPY pyproject.toml constraints.txt setup.py README.md Makefile ./
COPY .ci ./.ci
COPY app/numerics/kernels ./app/numerics/kernels
RUN touch app/__init__.py \
    && make install VENV=/opt/roadprint/.venv EXTRAS=
COPY app ./app
COPY migrations ./migrations
RUN python -m compileall -q app migrations

FROM python:3.11-slim-bookworm
RUN groupadd --system --gid 10001 roadprint \
    && useradd --system --uid 10001 --gid roadprint --no-create-home --shell /usr/sbin/nologin roadprint \
    && install -d -o roadprint -g roadprint /data
COPY --from=build /opt/roadprint /opt/roadprint
ENV PATH=/opt/roadprint/.venv/bin:$PATH \
    PYTHONUNBUFFERED=1 \
    OPENBLAS_NUM_THREADS=1
WORKDIR /opt/roadprint
USER 10001:10001
VOLUME /data
EXPOSE 8000
HEALTHCHECK --interval=10s --timeout=3s --start-period=20s --retries=3 \
    CMD ["python", "-c", "import urllib.request; urllib.request.urlopen('http://127.0.0.1:8000/livez', timeout=2)"]
CMD ["roadprint", "serve", "--data", "/data", "--host", "0.0.0.0", "--port", "8000"]

# Executable and driver:
#   docker build -t thud .
#   docker run --rm -v "${PWD}:/work" thud thud-driver run mine.nml
# The explorer, at the printed address:
#   docker run --rm -it -p 127.0.0.1:8000:8000 -v "${PWD}:/work" thud \
#     thud-driver explore --host 0.0.0.0 --port 8000 --no-browser
ARG BASE=python:3.13-slim-bookworm

FROM ${BASE} AS wheel
WORKDIR /thud
COPY . .
RUN ./bootstrap wheel

FROM ${BASE}
# The libraries that lay out the text of reports.
# hadolint ignore=DL3008
RUN apt-get update \
    && apt-get install --yes --no-install-recommends libpango-1.0-0 libpangoft2-1.0-0 libharfbuzz-subset0 \
    && rm -rf /var/lib/apt/lists/*
RUN --mount=type=bind,from=wheel,source=/thud/dist,target=/dist \
    pip install --no-cache-dir "$(echo /dist/*.whl)[studies,recordings,report,explorer]"
RUN useradd --create-home --uid 1000 thud
USER 1000
WORKDIR /work
EXPOSE 8000
CMD ["thud-driver", "--help"]

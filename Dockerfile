# docker build -t texbake .
# docker run --rm -v "$PWD:/work" -u "$(id -u):$(id -g)" texbake unwrap low.obj -o low_uv.obj
FROM python:3.13-slim AS build
WORKDIR /source
COPY pyproject.toml README.md LICENSE MANIFEST.in ./
COPY cli cli
COPY texbake texbake
RUN pip wheel --no-cache-dir --no-deps -w /wheels .

FROM python:3.13-slim
RUN --mount=type=bind,from=build,source=/wheels,target=/wheels \
    pip install --no-cache-dir --only-binary :all: /wheels/*.whl
ENV HOME=/tmp
WORKDIR /work
ENTRYPOINT ["texbake"]
CMD ["--help"]

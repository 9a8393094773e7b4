# Not tried yet. The command `fclib`: docker build --tag fclib . && docker run --rm -v "$PWD:/data" fclib info FILE
FROM debian:13-slim AS build
RUN apt-get update && apt-get install -y --no-install-recommends \
    g++ cmake ninja-build pkg-config libhdf5-dev libeigen3-dev python3-dev python3-venv git \
    && rm -rf /var/lib/apt/lists/*
COPY . /source
RUN python3 -m venv /opt/fclib \
    && /opt/fclib/bin/pip install --no-cache-dir \
       "/source[simulate,analysis,collection,bench,report]" /source/collection /source/results

FROM debian:13-slim
RUN apt-get update && apt-get install -y --no-install-recommends \
    python3 libhdf5-310 libgomp1 libgl1 libegl1 libosmesa6 \
    && rm -rf /var/lib/apt/lists/*
COPY --from=build /opt/fclib /opt/fclib
ENV PATH=/opt/fclib/bin:$PATH
WORKDIR /data
ENTRYPOINT ["fclib"]

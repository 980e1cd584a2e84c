# Stands for docker.io/prom/prometheus.
ARG BASE
FROM ${BASE}
RUN apt-get update -qq && \
    DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends prometheus wget >/dev/null && \
    install -d -m 1777 /prometheus
VOLUME /prometheus
ENTRYPOINT ["prometheus"]

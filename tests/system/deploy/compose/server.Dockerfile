# Stands for the image of deploy/image/Dockerfile: its last stage, with the packages of `make deb`.
ARG BASE
FROM ${BASE}
COPY *.deb /tmp/
RUN apt-get update -qq && \
    DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends tini \
      /tmp/pepeseg-server_*.deb /tmp/pepeseg_*.deb >/dev/null && \
    usermod -u 10001 pepeseg && groupmod -g 10001 pepeseg && \
    install -d -o 10001 -g 10001 -m 750 /var/lib/pepeseg
USER 10001:10001
WORKDIR /var/lib/pepeseg
VOLUME /var/lib/pepeseg
HEALTHCHECK --interval=10s --timeout=6s --start-period=30s --retries=3 CMD ["pepeseg", "health"]
ENTRYPOINT ["/usr/bin/tini", "--", "pepesegd", "--data=/var/lib/pepeseg"]

# The gateway of deploy/gateway as an image: Debian's HAProxy, as a user who may nothing.
#   docker build -f deploy/image/gateway.Dockerfile -t pepeseg-gateway .
ARG BASE=docker.io/library/debian:bookworm-slim
FROM ${BASE}
RUN apt-get update -qq && \
    DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends \
      haproxy lua-luaossl >/dev/null && \
    apt-get clean && rm -rf /var/lib/apt/lists/* /var/cache/* /var/log/*
COPY deploy/gateway/haproxy.cfg deploy/gateway/tls_errors.lua /etc/haproxy/
USER 10001:10001
EXPOSE 8443 8405
# Ends when the calls under way have; the engine's patience bounds it.
STOPSIGNAL SIGUSR1
# Its metrics' port answers once it runs; bash, since there is no curl.
HEALTHCHECK --interval=10s --timeout=3s --retries=3 CMD ["bash", "-c", \
  "a=${PEPESEG_GATEWAY_METRICS-127.0.0.1:8405}; exec 3<>/dev/tcp/127.0.0.1/${a##*:} && printf 'GET /metrics HTTP/1.0\\r\\n\\r\\n' >&3 && grep -q -m1 '^haproxy_' <&3"]
ENTRYPOINT ["haproxy", "-W", "-db", "-f", "/etc/haproxy/haproxy.cfg"]

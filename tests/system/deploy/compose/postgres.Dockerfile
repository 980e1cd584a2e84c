# Stands for docker.io/library/postgres:15, with the part of its entry point that compose.yaml uses.
ARG BASE
FROM ${BASE}
RUN apt-get update -qq && \
    DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends postgresql-15 >/dev/null && \
    install -d -m 1777 /var/lib/postgresql/data && rm -rf /run/postgresql
COPY postgres_entry.sh /entry.sh
VOLUME /var/lib/postgresql/data
ENV PATH=/usr/lib/postgresql/15/bin:/usr/bin:/bin
ENTRYPOINT ["bash", "/entry.sh"]

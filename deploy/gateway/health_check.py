#!/usr/bin/env python3
"""Prints, in hex, the bytes of a grpc.health.v1 request that haproxy.cfg sends to a server, and the bytes
that it expects in the response.

    health_check.py [SERVICE]      without a service: the server as a whole

HAProxy's own HTTP checks cannot be used: gRPC always responds with HTTP status 200.
"""
import sys

PREFACE = b'PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n'
HEADERS, DATA, SETTINGS = 1, 0, 4
END_STREAM, END_HEADERS = 1, 4
# Entries of HPACK's static table: whole fields, and names of fields.
METHOD_POST, SCHEME_HTTPS = b'\x83', b'\x87'
AUTHORITY, PATH, CONTENT_TYPE = 1, 4, 31
SERVING = b'\x08\x01'  # HealthCheckResponse{status: SERVING}


def frame(kind, flags, stream, payload):
    return (len(payload).to_bytes(3, 'big') + bytes([kind, flags]) + stream.to_bytes(4, 'big') + payload)


def text(value):
    encoded = value.encode()
    if len(encoded) > 126:
        sys.exit('a name of a service has at most 126 bytes')
    return bytes([len(encoded)]) + encoded


def field(index, value):
    """Returns a literal field that is not added to the table. An index from 15 on takes two bytes."""
    name = bytes([index]) if index < 15 else bytes([15, index - 15])
    return name + text(value)


def message(body):
    return b'\0' + len(body).to_bytes(4, 'big') + body


def query(service):
    headers = (METHOD_POST + SCHEME_HTTPS + field(PATH, '/grpc.health.v1.Health/Check') +
               field(AUTHORITY, 'gateway') + field(CONTENT_TYPE, 'application/grpc') +
               b'\0' + text('te') + text('trailers'))
    body = message(b'\x0a' + text(service) if service else b'')
    return (PREFACE + frame(SETTINGS, 0, 0, b'') + frame(HEADERS, END_HEADERS, 1, headers) +
            frame(DATA, END_STREAM, 1, body))


def main():
    service = sys.argv[1] if len(sys.argv) > 1 else ''
    print('tcp-check send-binary', query(service).hex())
    print('tcp-check expect binary', message(SERVING).hex())


if __name__ == '__main__':
    main()

#!/usr/bin/env python3
"""Tests deploy/gateway against the contract: configuration_test.py SOURCE_FOLDER

The configurations list methods by hand; the lists must match the contract. Exits with 77 (skipped)
without PyYAML.
"""
import pathlib
import re
import subprocess
import sys

try:
    import yaml
except ImportError:
    print('PyYAML is not there')
    sys.exit(77)

SOURCE = pathlib.Path(sys.argv[1])
GATEWAY = SOURCE / 'deploy/gateway'
HAPROXY = (GATEWAY / 'haproxy.cfg').read_text()
ENVOY = yaml.safe_load((GATEWAY / 'envoy.yaml').read_text())
# Streams whose messages the gateway does not keep.
CONVERSATIONS = {'/pepeseg.v1.SegmentationService/StreamSegments'}
# Unary calls that may take an hour.
LONG = {'/pepeseg.v1.EvaluationService/EvaluateModel'}
failures = []


def expect(condition, what):
    if not condition:
        failures.append(what)


def read_methods():
    """Returns path -> (streams, scope) for the methods of every service."""
    methods = {}
    for proto in sorted((SOURCE / 'proto/pepeseg/v1').glob('*.proto')):
        text = re.sub(r'//.*', '', proto.read_text())
        for service, body in re.findall(r'^service (\w+) \{(.*?)^\}', text, re.S | re.M):
            for name, takes, gives, options in re.findall(
                    r'rpc (\w+)\((.*?)\)\s*returns\s*\((.*?)\)\s*\{(.*?)\n  \}', body, re.S):
                scope = re.search(r'scope: SCOPE_(\w+)', options).group(1)
                streams = takes.startswith('stream') or gives.startswith('stream')
                methods[f'/pepeseg.v1.{service}/{name}'] = (streams, scope)
    return methods


def acl(name):
    """Returns (criterion, patterns) of each line of an ACL of haproxy.cfg."""
    return [(words[0], words[1:]) for words in
            (line.split() for line in re.findall(rf'^\s*acl {name} (.*)$', HAPROXY, re.M))]


def matches(lines, path):
    tests = {'path': path.__eq__, 'path_beg': path.startswith, 'path_end': path.endswith,
             'path_sub': path.__contains__}
    return any(tests[criterion](pattern) for criterion, patterns in lines for pattern in patterns)


def check_haproxy(methods):
    timeouts = re.findall(r'set-timeout server \S+ if \{ path (.*?) \}', HAPROXY)
    with_timeout = {path for line in timeouts for path in line.split()}
    to_service, is_stream, is_read = acl('to_service'), acl('is_stream'), acl('is_read')
    for path, (streams, scope) in methods.items():
        expect(matches(to_service, path) == ('AdminService' not in path), f'{path}: let through')
        if 'AdminService' in path:
            continue
        expect(matches(is_stream, path) == streams, f'{path}: is_stream')
        expect((path in with_timeout) == (streams or path in LONG), f'{path}: timeout')
        # Calls that change something must not be repeated.
        again = scope == 'READ' and path not in CONVERSATIONS
        expect(matches(is_read, path) == again, f'{path}: made again by the gateway')
    expect(not with_timeout - methods.keys(), f'no such method: {with_timeout - methods.keys()}')
    for path in ('/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo', '/', '/metrics'):
        expect(not matches(to_service, path), f'{path}: let through')


def check_health():
    printed = subprocess.run([sys.executable, GATEWAY / 'health_check.py'], capture_output=True,
                             text=True, check=True).stdout.splitlines()
    expect(len(printed) == 2, 'health_check.py prints two lines')
    for line in printed:
        expect(re.search(rf'^\s*{line}$', HAPROXY, re.M), f'not in haproxy.cfg: {line}')


def check_readme():
    """The README's table has the variables that the files use."""
    used = set(re.findall(r'PEPESEG_[A-Z0-9_]+', HAPROXY))
    table = '\n'.join(line for line in (GATEWAY / 'README.md').read_text().splitlines()
                      if line.startswith('| `'))
    told = set(re.findall(r'PEPESEG_[A-Z0-9_]+', table))
    if 'PEPESEG_SERVER_1` to `_' in table:
        told |= {name for name in used if re.fullmatch(r'PEPESEG_SERVER_\d+', name)}
    expect(used == told, f'in one of haproxy.cfg and README.md only: {sorted(used ^ told)}')


def check_envoy(methods):
    listener = ENVOY['static_resources']['listeners'][0]
    manager = listener['filter_chains'][0]['filters'][0]['typed_config']
    filters = {item['name'].split('.')[-1]: item['typed_config'] for item in manager['http_filters']}
    names = list(filters)
    expect(names.index('header_mutation') < names.index('jwt_authn') < names.index('lua'),
           f'filters in a wrong order: {names}')
    expect(names[-1] == 'router', 'the router comes last')
    services = {path.split('/')[1] for path in methods if 'AdminService' not in path}
    expect(set(filters['grpc_json_transcoder']['services']) == services, 'services of JSON')
    routes = manager['route_config']['virtual_hosts'][0]['routes']

    def find(path):
        for route in routes:
            match = route['match']
            if match.get('path') == path or path.startswith(match.get('prefix', '\0')):
                return route['route']
        return None

    for path, (streams, scope) in methods.items():
        route = find(path)
        expect((route is not None) == ('AdminService' not in path), f'Envoy: {path}: let through')
        if route is None:
            continue
        expect((route['timeout'] == '0s') == streams, f'Envoy: {path}: timeout')
        expect(route['hash_policy'] == [{'header': {'header_name': 'x-scene'}}],
               f'Envoy: {path}: hash')
        expect('reset' not in str(route.get('retry_policy')), f'Envoy: {path}: made again')
    cluster = ENVOY['static_resources']['clusters'][0]
    expect(cluster['lb_policy'] == 'RING_HASH', 'Envoy: ring hash')
    expect('grpc_health_check' in cluster['health_checks'][0], 'Envoy: health by gRPC')


def main():
    methods = read_methods()
    expect(len(methods) > 40, f'only {len(methods)} methods were found')
    expect(sum(streams for streams, _ in methods.values()) >= 4, 'streams were not found')
    check_haproxy(methods)
    check_health()
    check_readme()
    check_envoy(methods)
    for failure in failures:
        print(failure)
    sys.exit(1 if failures else 0)


main()

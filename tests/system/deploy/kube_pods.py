#!/usr/bin/env python3
"""Converts deploy/kubernetes to pods that `podman play kube` can run on one machine.

    kube_pods.py SECRETS_FOLDER DATA_FOLDER < MANIFESTS > PODS

Podman supports pods, deployments and config maps. So the StatefulSet becomes one pod, secrets and the
claim become folders of this machine, and services' names its loopback address. What only a cluster
enforces (services, network policies, disruption budgets) is left out. Images, commands, variables,
probes and security contexts are not changed.
"""
import sys

import yaml

secrets, data = sys.argv[1:]
documents = [d for d in yaml.safe_load_all(sys.stdin) if d]
maps = {d["metadata"]["name"]: d["data"] for d in documents if d["kind"] == "ConfigMap"}
maps["pepeseg-server"]["database"] = "postgresql:host=127.0.0.1 dbname=pepeseg user=pepeseg"


def here(volume):
    if "secret" in volume:
        path = secrets + ("/pgpass" if volume["secret"]["secretName"].endswith("pgpass") else "/tls")
    elif "persistentVolumeClaim" in volume:
        path = data
    else:
        return volume
    return {"name": volume["name"], "hostPath": {"path": path, "type": "Directory"}}


def container(spec):
    for variable in spec.get("env", []):
        if "valueFrom" in variable:
            ref = variable.pop("valueFrom")["configMapKeyRef"]
            variable["value"] = maps[ref["name"]][ref["key"]]
    variables = spec.get("env", [])
    if any(v["name"] == "PEPESEG_SERVERS_DNS" for v in variables):
        spec["env"] = [v for v in variables if v["name"] != "PEPESEG_SERVERS_DNS"]
        spec["env"] += [{"name": "PEPESEG_SERVER_1", "value": "127.0.0.1:50051"},
                        {"name": "PEPESEG_GATEWAY_CONNECTIONS", "value": "400"}]
    # A cluster would expand $(NAME).
    values = {v["name"]: v["value"] for v in spec.get("env", [])}
    for i, argument in enumerate(spec.get("args", [])):
        for name, value in values.items():
            argument = argument.replace(f"$({name})", value)
        spec["args"][i] = argument
    spec.pop("resources", None)  # cgroups may be another's
    spec.pop("ports", None)      # the network is the host's
    spec["imagePullPolicy"] = "Never"
    return spec


pods = []
for document in documents:
    if document["kind"] not in ("StatefulSet", "Deployment"):
        continue
    template = document["spec"]["template"]
    spec = template["spec"]
    spec["hostNetwork"] = True
    for key in ("topologySpreadConstraints", "tolerations", "automountServiceAccountToken"):
        spec.pop(key, None)
    spec["containers"] = [container(c) for c in spec["containers"]]
    spec["initContainers"] = [container(c) for c in spec.get("initContainers", [])]
    spec["volumes"] = [here(v) for v in spec["volumes"]]
    pods.append({"apiVersion": "v1", "kind": "Pod",
                 "metadata": {"name": document["metadata"]["name"],
                              "labels": template["metadata"]["labels"]},
                 "spec": spec})
assert len(pods) == 2, pods
yaml.safe_dump_all(pods, sys.stdout)
